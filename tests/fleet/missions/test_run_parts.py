"""The parts of the robots of a run: each begins once, ends once, and never begins again."""

import itertools

import pytest

from fleet.missions.program import Act
from fleet.missions.run_robots import COMES_DOWN, HALT, NOT_OURS, SHOWN_PARTS, RunRobots, first_identity
from fleet.missions.state import Begin, BeginTogether, LogNote, PartOutcome, RunMember, StepPart

GO = Act("goto", [1, 1], timeout=60.0)
LAND = Act("command", "land", timeout=30.0)


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


def begin(robots, robot="beast", act=GO, kind="do", *, step="go.1", now=5.0, **options):
    """Begin a part; return it, or None if nothing began."""
    before = len(robots.parts)
    robots.begin(step, robot, act, kind, now, **options)
    return list(robots.parts.values())[-1] if len(robots.parts) > before else None


def begun(robots):
    return [each.part.identity for each in robots.effects if isinstance(each, Begin)]


def notes(robots):
    return [(each.text, each.robot, each.step) for each in robots.effects if isinstance(each, LogNote)]


def test_a_part_begins_with_its_time_limit_and_a_line_in_the_log(robots):
    part = begin(robots)
    assert (part.identity, part.role, part.attempt) == ("run/go.1/beast/1", "feet", 1)
    assert part.identity == first_identity("run", "go.1", "beast")
    assert (part.began, part.until, part.inflight) == (5.0, 65.0, True)
    assert notes(robots) == [("begins goto", "beast", "go.1")]
    assert robots.touched == {part.identity: part}
    assert robots.active() == robots.parts_of("go.1") == [part]
    assert robots.parts_of("go.2") == []


@pytest.mark.parametrize(
    ("kind", "number"), [("do", "2"), ("undo", "undo.2"), ("abort", "abort.2"), ("secure", "secure.2")]
)
def test_parts_of_different_kinds_and_attempts_have_identities_of_their_own(robots, kind, number):
    part = begin(robots, kind=kind, attempt=2)
    assert part.identity == f"run/go.1/beast/{number}"
    assert robots.active(kind) == [part]
    assert robots.parts_of("go.1") == ([part] if kind == "do" else [])


@pytest.mark.parametrize("ended", [False, True])
def test_a_part_never_begins_again(robots, ended):
    part = begin(robots)
    if ended:
        robots.end(part, PartOutcome.FAILED, "no", 6.0)
    assert begin(robots) is None
    assert begun(robots) == [part.identity]


def test_a_part_that_was_recorded_never_begins_again_in_another_process(robots):
    part = begin(robots)
    again = RunRobots("run", crew(), [part])
    assert begin(again) is None
    assert again.active() == [part], "it may still be under way"
    robots.end(part, PartOutcome.DONE, "", 6.0)
    assert RunRobots("run", crew(), [part]).active() == []


def test_halts_are_numbered_also_after_those_of_another_process(robots):
    first = begin(robots, act=HALT, kind="halt")
    robots.end(first, PartOutcome.DONE, "", 6.0)
    second = begin(robots, act=HALT, kind="halt")
    assert [first.identity, second.identity] == ["run/go.1/beast/halt.1", "run/go.1/beast/halt.2"]
    again = RunRobots("run", crew(), [first, second])
    assert begin(again, act=HALT, kind="halt").identity == "run/go.1/beast/halt.3"


@pytest.mark.parametrize("outcome", sorted(NOT_OURS))
@pytest.mark.parametrize("kind", ["do", "halt", "secure", "undo", "abort"])
def test_a_robot_that_is_not_ours_is_never_commanded(robots, outcome, kind):
    robots.lose("beast", outcome, "gone", 1.0)
    assert begin(robots, kind=kind) is None
    assert begin(robots, "spot", kind=kind) is None
    assert begun(robots) == []
    assert [member.robot for member in robots.ours()] == ["kestrel", "rover"]


def test_a_robot_is_not_halted_twice_at_a_time(robots):
    robots.halt("go.1", "beast", 1.0)
    robots.halt("go.1", "beast", 2.0)
    robots.halt("go.1", "rover", 2.0)
    assert begun(robots) == ["run/go.1/beast/halt.1", "run/go.1/rover/halt.2"]
    assert notes(robots) == [], "a halt is no line of the log"


@pytest.mark.parametrize("command", sorted(COMES_DOWN))
@pytest.mark.parametrize("outcome", [None, *PartOutcome])
def test_a_robot_that_may_still_be_coming_down_is_not_halted(robots, command, outcome):
    part = begin(robots, act=Act("command", command))
    if outcome is not None:
        robots.end(part, outcome, "", 6.0)
    may = outcome in (None, PartOutcome.LATE, PartOutcome.UNKNOWN)
    assert robots.comes_down("beast") is may
    robots.halt("go.1", "beast", 7.0)
    assert bool(robots.active("halt")) is not may
    assert RunRobots("run", crew(), robots.parts.values()).comes_down("beast") is may


@pytest.mark.parametrize("act", [GO, Act("command", "takeoff"), Act("goto", "land"), None])
def test_any_other_act_is_ended_by_a_halt(robots, act):
    if act is not None:
        begin(robots, act=LAND, step="down.1", now=4.0)
        begin(robots, act=act)
    assert not robots.comes_down("beast")


def test_a_halt_does_not_hide_that_a_robot_comes_down():
    land = StepPart("1", "down.1", "beast", "feet", 1, "do", LAND, 1.0, 31.0)
    halt = StepPart("2", "down.1", "beast", "feet", 1, "halt", HALT, 2.0, 17.0)
    assert RunRobots("run", crew(), [halt, land]).comes_down("beast")


@pytest.mark.parametrize(
    ("outcome", "words"),
    [
        (PartOutcome.DONE, "has finished goto"),
        (PartOutcome.REFUSED, "was refused goto"),
        (PartOutcome.FAILED, "failed in goto"),
        (PartOutcome.LATE, "did not finish goto in time"),
        (PartOutcome.LOST, "was lost in goto"),
        (PartOutcome.TAKEN, "was taken in goto"),
        (PartOutcome.STOPPED, "was stopped in goto"),
        (PartOutcome.SKIPPED, "was ended in goto"),
        (PartOutcome.UNKNOWN, "ended goto without being observed"),
    ],
)
def test_the_end_of_a_part_is_told_with_its_reason(robots, outcome, words):
    part = begin(robots)
    robots.touched.clear()
    robots.end(part, outcome, "so it was", 6.0)
    assert robots.touched == {part.identity: part}
    robots.end(part, PartOutcome.DONE, "later", 7.0)
    assert (part.outcome, part.reason, part.ended) == (outcome, "so it was", 6.0), "an end is final"
    assert notes(robots)[1:] == [(f"{words}: so it was", "beast", "go.1")]
    assert robots.active() == []


def test_a_robot_seen_standing_is_no_line_and_one_that_does_not_stop_is():
    robots = RunRobots("run", crew())
    robots.end(begin(robots, act=HALT, kind="halt"), PartOutcome.DONE, "", 6.0)
    assert notes(robots) == []
    robots.end(begin(robots, act=HALT, kind="halt"), PartOutcome.UNKNOWN, "", 6.0)
    assert notes(robots) == [("ended to stop without being observed", "beast", "go.1")]


def test_those_prepared_begin_in_one_effect(robots):
    robots.note("before")
    robots.lose("rover", PartOutcome.LOST, "gone", 4.0)
    robots.begin_together("go.1", [("kestrel", GO), ("beast", GO), ("rover", GO)], 5.0)
    assert begun(robots) == []
    (together,) = [each for each in robots.effects if isinstance(each, BeginTogether)]
    assert robots.effects[-1] is together
    assert (together.step, [part.robot for part in together.parts]) == ("go.1", ["kestrel", "beast"])
    assert [text for text, _, _ in notes(robots)] == [
        "before",
        "is out of the run, lost: gone",
        "begins goto",
        "begins goto",
    ]


def test_only_the_newest_parts_are_shown_and_no_halt(robots):
    for number in itertools.count(1):
        begin(robots, step=f"go.{number}", now=float(number))
        begin(robots, step=f"go.{number}", act=HALT, kind="halt", now=float(number))
        if number == SHOWN_PARTS + 2:
            break
    shown = [part.identity for part in robots.shown_parts["beast"]]
    assert shown == [f"run/go.{number}/beast/1" for number in range(3, SHOWN_PARTS + 3)]
    again = RunRobots("run", crew(), reversed(robots.parts.values()))
    assert [part.identity for part in again.shown_parts["beast"]] == shown, "in order, from any order on disk"
    assert list(again.shown_parts["rover"]) == []
