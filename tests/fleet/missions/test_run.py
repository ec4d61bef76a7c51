"""One run in progress: recorded before anything is commanded, given up without leaving a robot moving."""

import sqlite3

import pytest

from fleet.config.missions import mission_of
from fleet.missions.observed import SHOWN_WITHIN
from fleet.missions.report import MissionStartRequest
from fleet.missions.store import RunStore
from fleet.model.command import Transport
from tests.fleet.missions.yard import MISSION


def test_a_robot_whose_state_does_not_say_yet_that_it_has_joined_is_not_lost(yard):
    yard.robots["kestrel"].be(left_run="taken: by anna")  # of an earlier run
    yard.robots["kestrel"].shows = False
    yard.start()
    yard.turn()
    assert yard.last.outcome == ""
    assert {robot.robot: robot.outcome for robot in yard.last.robots} == {"kestrel": "", "beast": ""}
    yard.turn(SHOWN_WITHIN)
    assert {robot.robot: robot.outcome for robot in yard.last.robots}["kestrel"] == "taken"


def test_what_is_begun_is_on_disk_before_the_robot_hears_of_it(yard):
    found = mission_of("patrol", MISSION)
    yard.runs.start(found, found.program({}), MissionStartRequest(run="3f2a"), Transport.BUS, lambda *_: None)
    assert yard.robots["kestrel"].names == [], "the disk has not said so yet"
    yard.settle()
    assert yard.robots["kestrel"].names == ["takeoff"]
    (kept,) = RunStore(yard.folder).unfinished()
    assert [part.identity for part in kept.parts] == ["3f2a/up.1/kestrel/1"]


def test_a_run_that_the_disk_does_not_take_begins_nothing(yard):
    yard.store._database.close()
    yard.store._database = sqlite3.connect(":memory:", check_same_thread=False)  # none of our tables
    yard.start()
    assert yard.last.outcome == "failed"
    assert "not started: the runs of missions are not recorded" in yard.last.reason
    assert yard.robots["kestrel"].names == []
    assert {robot.now.run for robot in yard.robots.values()} == {""}


def test_a_run_under_way_goes_on_though_the_disk_fails(yard):
    yard.start()
    yard.store._database.close()
    yard.store._database = sqlite3.connect(":memory:", check_same_thread=False)
    yard.done("kestrel", "takeoff")
    assert yard.robots["kestrel"].names == ["takeoff", "goto"]
    assert "not recorded" in yard.last.problem or yard.store.problem


@pytest.mark.parametrize(
    ("fields", "outcome"),
    [
        ({"run": "", "left_run": "taken: land by anna"}, "taken"),
        ({"run": "", "left_run": "stopped: stop by anna"}, "stopped"),
        ({"run": "", "left_run": "lost: no heartbeat"}, "lost"),
        ({"run": ""}, "lost"),
        ({"reachable": False, "cause": "no heartbeat"}, "lost"),
        ({"emergency_stop": True, "stop_cause": "anna"}, "stopped"),
    ],
)
def test_a_robot_that_left_is_not_commanded_again(yard, fields, outcome):
    yard.start()
    yard.robots["kestrel"].be(**fields)
    before = list(yard.robots["kestrel"].names)
    yard.turn()
    robots = {robot.robot: robot for robot in yard.last.robots}
    assert robots["kestrel"].outcome == outcome
    yard.done("beast", "stop")
    assert yard.last.outcome == "undone"  # nothing was left to be undone: the drone is not ours
    assert yard.robots["kestrel"].names == before


def test_a_run_that_fails_in_the_edge_stops_its_robots_and_ends_unknown(yard, monkeypatch):
    yard.start()
    monkeypatch.setattr(yard.runs._runs["3f2a"].engine.steps, "time_passes", None)
    yard.turn()
    assert yard.last.outcome == "unknown"
    assert yard.robots["kestrel"].names[-1] == yard.robots["beast"].names[-1] == "stop"
    assert {robot.now.run for robot in yard.robots.values()} == {""}
    assert yard.runs.states() == []
