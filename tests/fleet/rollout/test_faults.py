"""Faults of an edge that got worse, part by part, regardless of its health as a whole."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.health.aggregate import edge_health
from fleet.model.health import Health, Level, degraded
from fleet.model.state import EdgeState, RobotState
from fleet.rollout.faults import CLOUD, EDGE, WORSE, PartFault, faults_of, got_worse

WORDS = [level.word for level in Level]


def robot(name, health="ok", cause="", edge="yard-1"):
    return RobotState(name, "", "bot", edge, 0.0, health=health, cause=cause)


def edge(**fields):
    return EdgeState("yard-1", "0.2.0", 0.0, 1.0, **fields)


def test_a_fault_that_replaces_another_is_worse_at_the_same_health_of_the_edge():
    before = [robot("rex", "degraded", "battery 9 %"), robot("max")]
    after = [robot("rex"), robot("max", "degraded", "motor 3 is hot")]
    whole = [edge_health(states, ()).level for states in (before, after)]
    assert whole == [Level.DEGRADED, Level.DEGRADED]
    worse = got_worse(faults_of(edge(health="degraded"), before), faults_of(edge(health="degraded"), after))
    assert worse == ("max is degraded, was ok: motor 3 is hot",)


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        (("ok", ""), ("offline", "silent"), "rex is offline, was ok: silent"),
        (("degraded", "battery"), ("offline", "silent"), "rex is offline, was degraded: silent"),
        (("degraded", "battery"), ("degraded", "hot"), "rex is degraded for another cause than before: hot"),
        (("degraded", "battery 9.5 %"), ("degraded", "battery 8 %"), ""),
        (("offline", "silent for 300 s"), ("offline", "starting"), ""),
        (("offline", "silent"), ("fault", "no such file"), "rex is fault, was offline: no such file"),
        (("offline", "silent"), ("degraded", "battery"), ""),
        (("fault", "quarantined"), ("fault", "ValueError: x"), ""),
        (("fault", "quarantined"), ("offline", "starting"), ""),
        (("fault", "quarantined"), ("ok", ""), ""),
    ],
)
def test_a_robot_fails_a_bundle_only_when_it_is_worse_than_before(before, after, expected):
    faults = [faults_of(edge(), [robot("rex", *state)]) for state in (before, after)]
    assert got_worse(*faults) == ((expected,) if expected else ())


def test_a_new_robot_must_be_ok_and_a_removed_one_is_ignored():
    was = faults_of(edge(), [robot("rex", "fault", "x")])
    assert got_worse(was, faults_of(edge(), [robot("ada")])) == ()
    assert got_worse(was, faults_of(edge(), [robot("ada", "offline", "silent")])) == (
        "ada is offline, was ok: silent",
    )


def test_each_problem_of_the_edge_itself_counts_separately():
    before = faults_of(edge(health="degraded", problems=["the disk has 90 MB left"]), ())
    assert got_worse(before, faults_of(edge(problems=["the disk has 80 MB left"]), ())) == ()
    both = edge(health="degraded", problems=["the disk has 80 MB left", "no port 9100"])
    assert got_worse(before, faults_of(both, ())) == ("the edge is degraded, was ok: no port 9100",)


def test_an_unreachable_cloud_may_change_its_cause():
    away = [
        faults_of(edge(cloud=state, cloud_cause=f"cloud {state}: {why}", health="degraded"), ())
        for state, why in (("connecting", "no answer"), ("disconnected", "no route"))
    ]
    assert got_worse(*away) == ()
    refused = faults_of(edge(cloud="refused", cloud_cause="cloud refused: bad user", health="fault"), ())
    assert got_worse(away[0], refused) == ("the cloud is fault, was offline: cloud refused: bad user",)
    assert got_worse(refused, away[0]) == ()


def test_an_older_edge_without_reported_problems_is_compared_by_its_health():
    assert faults_of(edge(health="degraded", cause="no port 9100"), [robot("rex")]) == (
        PartFault(EDGE, "degraded", "no port 9100"),
    )
    explained = edge(health="degraded", cause="rex offline: silent")
    assert faults_of(explained, [robot("rex", "offline", "silent")]) == (
        PartFault("rex", "offline", "silent"),
    )


def test_robots_of_other_edges_on_the_bus_do_not_count():
    assert faults_of(edge(), [robot("rex", "fault", "x", edge="yard-2")]) == ()


def test_an_edge_reports_the_problems_that_the_comparison_needs():
    """The cause in the health of an edge is found again in its problems."""
    problems = ["no port 9100", "history: disk full"]
    health = edge_health((), map(degraded, problems))
    reported = edge(health=health.level.word, cause=health.cause, problems=problems)
    assert faults_of(reported, ()) == tuple(PartFault(EDGE, "degraded", each) for each in problems)


def test_the_table_has_every_pair_of_levels():
    assert all(set(WORSE[before]) == set(Level) for before in Level)


causes = st.sampled_from(["silent for 3 s", "silent for 17.5 s", "battery", "quarantined after 3 crashes"])
faults = st.builds(
    PartFault, st.sampled_from(["rex", "max", CLOUD, EDGE]), st.sampled_from(WORDS[1:]), causes
)


def one_a_part(found):
    """Return the first fault of each part; the edge itself may have several."""
    kept = {fault.part if fault.part != EDGE else (EDGE, fault.cause[:6]): fault for fault in found}
    return tuple(kept.values())


snapshots = st.lists(faults, max_size=8).map(one_a_part)


@given(snapshot=snapshots)
def test_an_unchanged_state_is_never_worse(snapshot):
    assert got_worse(snapshot, snapshot) == ()
    assert got_worse(snapshot, ()) == ()


@given(before=snapshots, after=snapshots)
def test_any_part_that_was_ok_and_is_not_is_worse(before, after):
    ill = {fault.part for fault in before}
    new = [fault for fault in after if fault.part not in ill]
    worse = got_worse(before, after)
    assert all(f"{each.part} is {each.level}, was ok: {each.cause}" in worse for each in new)


@given(before=snapshots, after=snapshots, part=st.sampled_from(["rex", "max", CLOUD]))
def test_each_part_is_compared_only_with_itself(before, after, part):
    def of(snapshot):
        return tuple(fault for fault in snapshot if fault.part == part)

    alone = got_worse(of(before), of(after))
    assert tuple(line for line in got_worse(before, after) if line.startswith(f"{part} ")) == alone


@given(before=snapshots, level=st.sampled_from(WORDS[1:]))
def test_a_part_with_a_milder_level_than_before_is_not_worse(before, level):
    after = tuple(
        msgspec.structs.replace(fault, level=level)
        if WORDS.index(level) < WORDS.index(fault.level)
        else fault
        for fault in before
    )
    assert got_worse(before, after) == ()


@given(before=snapshots, number=st.integers(0, 10**6))
def test_figures_in_a_cause_change_nothing(before, number):
    after = tuple(
        msgspec.structs.replace(
            fault, cause="".join(str(number) if each.isdigit() else each for each in fault.cause)
        )
        for fault in before
    )
    assert got_worse(before, after) == ()


def test_an_unknown_word_for_health_counts_as_the_worst():
    was = faults_of(edge(), [robot("rex", Health().level.word)])
    assert got_worse(was, (PartFault("rex", "molten", "?"),)) == ("rex is molten, was ok: ?",)
