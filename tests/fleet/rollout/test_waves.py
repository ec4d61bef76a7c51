"""Waves of a roll-out: the order of the edges, and when it stops."""

import json

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.rollout.waves import (
    EdgeStatus,
    FailureLimit,
    Plan,
    RolloutPhase,
    RolloutProgress,
    WavesError,
    aborted,
    limit_of,
    step,
    wave_ends,
)


def plan_of(edges, waves="1,10%,100%", stop_if="failed > 2%", parallel=20, within=60.0):
    names = tuple(f"edge-{number:03}" for number in range(edges))
    return Plan(names, wave_ends(waves, edges), limit_of(stop_if), parallel, within)


def run(plan, failing=(), silent=()):
    """Run a roll-out in which every edge answers one step after it got its bundle."""
    progress, history = RolloutProgress(), []
    for now in range(1000):
        seen = {
            name: EdgeStatus.FAILED if name in failing else EdgeStatus.DONE
            for name in progress.statuses
            if name not in silent
        }
        progress = step(plan, progress, seen, float(now))
        history.append(progress)
        if progress.phase is not RolloutPhase.RUNNING:
            return progress, history
    raise AssertionError("it never ends")


@pytest.mark.parametrize(
    ("text", "edges", "ends"),
    [
        ("1,10%,100%", 100, (1, 10, 100)),
        ("1,10%,100%", 5, (1, 5)),
        ("1,50%", 10, (1, 5, 10)),
        ("3", 3, (3,)),
        ("1,5%,25%,100%", 30, (1, 2, 8, 30)),
        ("5,100%", 3, (3,)),
    ],
)
def test_waves_count_all_edges_so_far_and_the_last_one_is_all(text, edges, ends):
    assert wave_ends(text, edges) == ends


@pytest.mark.parametrize("text", ["", "0,100%", "10,5", "101%", "a", "1,,2", "50%,10%", "-1", "1.5"])
def test_invalid_waves_are_refused(text):
    with pytest.raises(WavesError, match="no waves"):
        wave_ends(text, 100)


@pytest.mark.parametrize("text", ["", "failed", "failed > ", "failed < 2%", "failed > 101%", "health worse"])
def test_an_invalid_limit_is_refused(text):
    with pytest.raises(WavesError, match="no limit"):
        limit_of(text)


def test_a_limit_is_a_share_of_the_assigned_edges_or_a_number():
    assert limit_of("failed > 2%") == FailureLimit(2.0, percent=True)
    assert limit_of("failed>0") == FailureLimit(0.0, percent=False)
    assert not FailureLimit(2.0, percent=True).is_exceeded(2, 100)
    assert FailureLimit(2.0, percent=True).is_exceeded(3, 100)
    assert FailureLimit(0.0, percent=False).is_exceeded(1, 100)


def test_a_bundle_that_no_edge_can_use_stops_in_its_first_wave():
    plan = plan_of(100)
    progress, _ = run(plan, failing=plan.edges)
    assert progress.phase is RolloutPhase.STOPPED
    assert list(progress.statuses) == ["edge-000"]
    assert progress.why == "1 of 1 edges failed: edge-000"


def test_without_failures_every_edge_is_assigned_once_and_it_completes():
    plan = plan_of(100)
    progress, _ = run(plan)
    assert progress.phase is RolloutPhase.COMPLETED
    assert list(progress.statuses) == list(plan.edges)


def test_one_failure_in_the_last_wave_stops_before_most_edges_are_assigned():
    plan = plan_of(100, parallel=5)
    progress, _ = run(plan, failing={"edge-012"})
    assert progress.phase is RolloutPhase.STOPPED
    assert len(progress.statuses) <= 15


def test_a_silent_edge_is_overdue_after_its_time_and_counts_as_failed():
    plan = plan_of(3, waves="100%", stop_if="failed > 0")
    progress, _ = run(plan, silent={"edge-001"})
    assert progress.phase is RolloutPhase.STOPPED
    assert progress.statuses["edge-001"] is EdgeStatus.OVERDUE
    assert progress.why == "1 of 3 edges failed: edge-001"


def test_an_aborted_roll_out_assigns_no_further_edges():
    plan = plan_of(10)
    progress = step(plan, RolloutProgress(), {}, 0.0)
    ended = aborted(progress, "alice")
    assert step(plan, ended, {"edge-000": EdgeStatus.DONE}, 1.0) == ended
    assert (
        aborted(msgspec.structs.replace(ended, phase=RolloutPhase.COMPLETED), "bob").phase
        is RolloutPhase.COMPLETED
    )


verdicts = st.sampled_from([EdgeStatus.OPEN, EdgeStatus.DONE, EdgeStatus.FAILED])


@given(
    edges=st.integers(1, 60),
    waves=st.sampled_from(["1,10%,100%", "100%", "2,50%", "1,2,3"]),
    stop_if=st.sampled_from(["failed > 2%", "failed > 0", "failed > 30%", "failed > 3"]),
    parallel=st.integers(1, 70),
    data=st.data(),
)
def test_the_invariants_hold_at_every_step_for_any_behaviour_of_edges(edges, waves, stop_if, parallel, data):
    plan = plan_of(edges, waves, stop_if, parallel)
    progress, now = RolloutProgress(), 0.0
    for _ in range(40):
        before = progress
        seen = {name: data.draw(verdicts) for name in data.draw(st.sets(st.sampled_from(plan.edges)))}
        now += data.draw(st.sampled_from([0.0, 1.0, 61.0]))
        progress = step(plan, before, seen, now)
        kept = msgspec.json.decode(msgspec.json.encode(before), type=RolloutProgress)
        assert step(plan, kept, seen, now) == progress, "a resumed roll-out goes on as if never detached"
        holds(plan, before, progress)
        if progress.phase is not RolloutPhase.RUNNING:
            assert step(plan, progress, seen, now + 99.0) == progress
            return


def holds(plan, before, progress):
    """Assert the invariants of every step."""
    assigned = list(progress.statuses)
    new = assigned[len(before.statuses) :]
    assert assigned == list(plan.edges[: len(assigned)]), "edges are told in order, each once"
    settled = {name: state for name, state in before.statuses.items() if state is not EdgeStatus.OPEN}
    assert settled.items() <= progress.statuses.items(), "an edge that has settled stays so"
    assert not new or progress.count(EdgeStatus.OPEN) <= plan.parallel
    failed = progress.count(EdgeStatus.FAILED) + progress.count(EdgeStatus.OVERDUE)
    exceeded = plan.limit.is_exceeded(failed, len(assigned) - len(new))
    assert exceeded == (progress.phase is RolloutPhase.STOPPED)
    assert not (new and exceeded)
    waves = [sum(end <= plan.edges.index(name) for end in plan.ends) for name in assigned]
    for name in new:
        wave = waves[assigned.index(name)]
        earlier = [each for each, at in zip(assigned, waves, strict=True) if at < wave]
        assert all(progress.statuses[each] is not EdgeStatus.OPEN for each in earlier), (
            "the wave before has settled"
        )
    if progress.phase is RolloutPhase.COMPLETED:
        assert assigned == list(plan.edges)
        assert not progress.count(EdgeStatus.OPEN)


def test_progress_is_stored_as_plain_json():
    progress = step(plan_of(2), RolloutProgress(), {}, 3.0)
    assert json.loads(msgspec.json.encode(progress)) == {
        "phase": "running",
        "told": {"edge-000": "open"},
        "since": {"edge-000": 3.0},
        "why": "",
    }
