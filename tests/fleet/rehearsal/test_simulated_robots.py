"""Who plays which robot in a rehearsal, and where it stands."""

import math

import msgspec
import pytest

from fleet.model.geometry import Vector3
from fleet.model.site import Placement
from fleet.rehearsal.simulated_robots import start_of, substitutes_of

MISSION = {"roles": {"all-there-is": {}}, "steps": [{"id": "rest", "wait": "1 s"}]}


def players(yard, *names):
    return {
        player.name: player for player in substitutes_of(yard.task(MISSION, {"all-there-is": list(names)}))
    }


def test_robots_with_a_role_are_simulated_and_the_others_stand_where_they_are(field):
    found = players(field(), "drone-1", "ugv-1", "dog-1")
    assert {name: (player.simulation is not None, player.played_by) for name, player in found.items()} == {
        "drone-1": (True, "simulated PX4 multirotor"),
        "ugv-1": (True, "simulated waveshare-beast, whose battery does not drain"),
        "dog-1": (False, "kinematic stand-in: quadruped has no simulator that runs in simulated time"),
    }
    parked = players(field(), "ugv-1")["drone-1"]
    assert (parked.simulation, parked.played_by) == (None, "stand-in that stands where the robot is")


def test_a_robot_whose_place_nobody_knows_is_left_out_unless_it_takes_part(field):
    yard = field()
    yard.state("dog-1", site=None, placement=None)
    assert set(players(yard, "ugv-1")) == {"drone-1", "ugv-1"}
    assert players(yard, "dog-1")["dog-1"].config.start == (0.0, -4.0, 0.0)


def test_what_a_robot_accepts_and_where_its_world_lies_stay_as_they_are(field):
    yard = field(**{"ugv-1": {"accepts": {"mission": ["tele"]}}})
    yard.state("ugv-1", site=Vector3(4.0, 3.0), heading=0.5, placement=Placement(Vector3(4.0), 1.0))
    config = players(yard, "ugv-1")["ugv-1"].config
    assert config.start == (4.0, 3.0, 1.5)
    assert config.accepts.command == {"sim_tele", "sim"}, "it is simulated in the field too"
    assert config.accepts.mission == {"tele"}
    assert config.link == "memory:ugv-1"


def test_a_robot_begins_as_its_state_tells(field):
    yard = field()
    state = msgspec.structs.replace(yard.states["drone-1"], mode="AUTO.LOITER", armed=True, heading=0.25)
    start = start_of(state, yard.task(MISSION, {}).site, seed=7)
    assert (start.battery, start.mode, start.armed, start.seed) == (90.0, "AUTO.LOITER", True, 7)
    assert start.heading == pytest.approx(0.25)
    assert start.point.latitude == pytest.approx(47.397742 + 11 / 111_195, abs=1e-6)
    assert start.pose.rotation.yaw == pytest.approx(0.25)
    nowhere = start_of(msgspec.structs.replace(state, site=None, placement=None, position=None), None, 1)
    assert (nowhere.point, nowhere.heading, nowhere.pose.position) == (None, None, Vector3())
    assert math.isclose(nowhere.pose.rotation.yaw, 0.0)
