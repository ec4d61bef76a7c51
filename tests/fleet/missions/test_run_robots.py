"""The robots of a run: who takes part, who does what, and who is lost."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.missions.program import Act
from fleet.missions.run_robots import NOT_OURS, RunRobots
from fleet.missions.state import LogNote, PartOutcome, RunMember

GO = Act("goto", [1, 1], timeout=60.0)
LAND = Act("command", "land", timeout=30.0)
OUTCOMES = [outcome for outcome in PartOutcome if outcome is not PartOutcome.SKIPPED]


def crew():
    return [
        RunMember("kestrel", "eye", 0, {"in.up": 0}),
        RunMember("beast", "feet", 0, {"in.down": 1}),
        RunMember("rover", "feet", 1),
        RunMember("spot", "feet", 0, ours=False, within=False, spare=True),
    ]


@pytest.fixture
def robots():
    return RunRobots("run", crew())


def begin(robots, kind="do"):
    robots.begin("go.1", "beast", GO, kind, 5.0)
    return list(robots.parts.values())[-1]


def notes(robots):
    return [(each.text, each.robot, each.step) for each in robots.effects if isinstance(each, LogNote)]


def names(members):
    return [member.robot for member in members]


def test_those_that_take_part_are_chosen_by_role_or_by_a_role_of_an_inner_mission(robots):
    assert names(robots.within()) == ["kestrel", "beast", "rover"]
    assert names(robots.within(["feet"])) == ["beast", "rover"]
    assert names(robots.within(["in.up", "feet"])) == ["kestrel", "beast", "rover"]
    assert names(robots.within(["nobody"])) == []
    assert robots.plays("kestrel", "eye")
    assert robots.plays("kestrel", "in.up")
    assert not robots.plays("kestrel", "feet")


@pytest.mark.parametrize(
    ("acts", "expected"),
    [
        ({"feet": (GO,), "all": (LAND,)}, GO),
        ({"in.down": (GO, LAND), "all": (GO,)}, LAND),
        ({"all": (LAND,)}, LAND),
        ({"feet": (), "all": (LAND,)}, LAND),
        ({"eye": (GO,)}, None),
        ({}, None),
    ],
)
def test_the_act_of_a_robot_is_that_of_its_own_role_before_that_of_all(robots, acts, expected):
    assert robots.act_of(robots.members["beast"], acts) == expected


@given(count=st.integers(1, 4), index=st.integers(0, 9))
def test_each_robot_of_a_role_has_an_act_of_its_own_and_too_few_acts_start_over(count, index):
    acts = tuple(Act("goto", [each, 0]) for each in range(count))
    found = RunRobots("run", []).act_of(RunMember("rex", "feet", index), {"feet": acts})
    assert found == acts[index % count]


def test_who_follows_follows_the_first_that_still_takes_part(robots):
    acts = {"eye": (Act("follow", "feet"),)}
    act_of = lambda: robots.act_of(robots.members["kestrel"], acts).value  # noqa: E731
    assert act_of() == "beast"
    robots.lose("beast", PartOutcome.LOST, "gone", 1.0)
    assert act_of() == "rover"
    robots.lose("rover", PartOutcome.LOST, "gone", 1.0)
    assert act_of() == ""


def test_only_those_that_take_part_get_an_act(robots):
    robots.lose("beast", PartOutcome.FAILED, "no", 1.0)
    assert robots.acts_of({"feet": (GO, LAND)}) == [("rover", LAND)]


@pytest.mark.parametrize("outcome", OUTCOMES)
def test_a_lost_robot_ends_its_part_and_what_may_still_be_done_with_it(robots, outcome):
    robots.begin("go.1", "rover", GO, "do", 5.0)
    part, secured = begin(robots), begin(robots, kind="secure")
    assert robots.lose("beast", outcome, "so it was", 9.0)
    member = robots.members["beast"]
    gone = outcome in NOT_OURS
    assert (member.within, member.ours, member.outcome, member.since) == (False, not gone, outcome, 9.0)
    assert (part.outcome, secured.inflight) == (outcome, not gone)
    assert [part.robot for part in robots.active("do")] == ["rover"]
    assert robots.touched["member beast"] is member
    assert notes(robots)[-1] == (f"is out of the run, {outcome}: so it was", "beast", "")
    assert robots.needs("beast") is not gone


def test_a_robot_that_failed_may_be_taken_later_and_keeps_why_it_failed(robots):
    robots.lose("beast", PartOutcome.FAILED, "its motor stalls", 5.0)
    robots.effects.clear()
    assert not robots.lose("beast", PartOutcome.TAKEN, "anna", 9.0)
    member = robots.members["beast"]
    assert (member.ours, member.outcome, member.reason) == (False, PartOutcome.FAILED, "its motor stalls")
    assert notes(robots) == []


def test_a_lost_spare_is_no_spare_any_more(robots):
    assert names(robots.spares("feet")) == names(robots.spares("all")) == ["spot"]
    assert robots.spares("eye") == []
    assert robots.needs("spot")
    assert not robots.lose("spot", PartOutcome.STOPPED, "anna", 1.0)
    assert robots.spares("all") == []
    assert not robots.needs("spot")
    assert not robots.needs("stranger")


@pytest.mark.parametrize(
    ("quorum", "with_spares", "words"),
    [
        ({"feet": 2, "eye": 1}, False, ""),
        ({"feet": 3}, False, "role feet has 2 of the 3 robots that it needs"),
        ({"feet": 3}, True, ""),
        ({"feet": 4}, True, "role feet has 3 of the 4 robots that it needs"),
        ({"eye": 2, "feet": 9}, True, "role eye has 1 of the 2 robots that it needs"),
        ({"in.down": 1}, False, ""),
        ({}, False, ""),
    ],
)
def test_a_shortage_is_told_with_the_role_and_both_numbers(robots, quorum, with_spares, words):
    assert robots.shortage(quorum, with_spares=with_spares) == words


def test_an_unused_spare_is_no_lost_robot(robots):
    assert not robots.has_lost_robot()
    assert robots.shortage({"feet": 3}) == "role feet has 2 of the 3 robots that it needs"
    robots.lose("rover", PartOutcome.FAILED, "no", 1.0)
    assert robots.has_lost_robot()
