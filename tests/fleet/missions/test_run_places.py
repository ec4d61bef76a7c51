"""Runs that want the same places: who waits, for whom, for how long, and what a restart leaves of it."""

import pytest

from fleet.config.missions import mission_of
from fleet.missions.report import MissionStartRequest, RunControlRequest
from fleet.missions.state import Phase


def mission(robot, *places, **more):
    go = {"id": "go", "do": {"feet": {"goto": [1, 2]}}}
    return {
        "version": 1,
        "roles": {"feet": {"from": robot}},
        "occupies": list(places),
        "steps": [go],
        **more,
    }


@pytest.fixture
def runs(yard):
    """Have one run at the gate, and start another that wants it too; gives the yard."""
    yard.start(mission("beast", "gate"), run="a")
    yard.start(mission("kestrel", "gate", occupy_within="1 min"), run="b")
    return yard


def state(yard, run):
    return next(each for each in reversed(yard.states) if each.run == run)


def test_the_second_run_waits_and_says_for_what_and_for_whom(runs):
    assert (state(runs, "b").phase, state(runs, "b").waits_for) == (
        "occupying",
        "gate, which run a of patrol has",
    )
    assert runs.robots["kestrel"].now.run == "b", "it has its robots"
    assert runs.robots["kestrel"].names == [], "and nothing is begun"


def test_it_begins_once_the_place_is_given_back(runs):
    runs.done("beast", "goto")
    assert state(runs, "a").outcome == "completed"
    assert runs.robots["kestrel"].names == ["goto"]
    assert state(runs, "b").waits_for == ""
    runs.done("kestrel", "goto")
    assert state(runs, "b").outcome == "completed"


def test_it_fails_when_the_place_does_not_become_free_in_time(runs):
    runs.turn(61.0)
    runs.done("kestrel", "stop")
    assert state(runs, "b").outcome == "failed"
    assert "gate did not become free in time: run a of patrol has it" in state(runs, "b").reason
    assert runs.robots["kestrel"].names == ["stop"]


def test_one_that_waits_can_be_aborted(runs):
    assert runs.control("b", RunControlRequest("abort")) == ""
    runs.settle()
    runs.done("kestrel", "stop")
    assert state(runs, "b").outcome == "aborted"
    runs.done("beast", "goto")
    assert runs.robots["kestrel"].names == ["stop"]


def test_a_place_is_had_by_as_many_runs_as_it_has_room_for(yard):
    yard.start(mission("beast", "pad"), run="a")
    yard.start(mission("kestrel", "pad"), run="b")
    assert yard.robots["beast"].names == yard.robots["kestrel"].names == ["goto"]


def test_a_place_that_there_is_not_is_refused_before_anything_moves(yard):
    ((run, _, refusal),) = yard.start(mission("beast", "gate", "moon"))
    assert (run, refusal) == ("", "occupies: there is no place 'moon'")
    assert yard.robots["beast"].requests == []


def restart(yard):
    yard.begin()
    for robot in yard.robots.values():
        robot.be(run="")
    yard.runs.restore_runs()


def test_after_a_restart_nobody_takes_a_place_of_a_run_that_is_not_back_yet(yard):
    yard.start(mission("beast", "gate", on_restart="continue"), run="a")
    yard.robots["beast"].be(reachable=False)
    restart(yard)
    yard.start(mission("kestrel", "gate"), run="b")
    assert state(yard, "b").waits_for == "gate, which run a of patrol has"
    assert yard.robots["kestrel"].names == []


def test_after_a_restart_who_waited_waits_again(yard):
    yard.start(mission("beast", "gate", on_restart="fail"), run="a")
    yard.start(mission("kestrel", "gate", on_restart="continue"), run="b")
    restart(yard)
    yard.settle()
    yard.turn()
    assert state(yard, "b").phase == Phase.OCCUPYING.value
    yard.done("beast", "stop")
    assert state(yard, "a").outcome == "failed"
    assert yard.robots["kestrel"].names == ["goto"]


def test_a_schedule_finds_only_a_run_in_the_way_where_there_is_no_room(yard):
    yard.start(mission("beast", "pad"), run="a")
    ask = MissionStartRequest(run="b")
    other = mission_of("other", mission("kestrel", "pad"))
    assert yard.runs.filling.conflicting_runs(other, other.program({}), ask) == []
    yard.start(mission("kestrel", "pad"), run="c")
    third = mission_of("other", {**mission("kestrel", "pad"), "roles": {"feet": {"count": {"min": 1}}}})
    yard.robots["kestrel"].be(run="")
    assert yard.runs.filling.conflicting_runs(third, third.program({}), ask) == ["a", "c"]
