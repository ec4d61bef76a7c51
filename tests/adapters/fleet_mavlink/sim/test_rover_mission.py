"""Missions of ArduRover: items are driven to, RTL is one of them, and at the end it stands in AUTO."""

import math

import pytest

from fleet_mavlink.sim.mission_items import Item
from fleet_mavlink.sim.missions import COMPLETE
from fleet_mavlink.sim.rover_moves import BRAKED

ACCEPTED = 0
WAYPOINT, UNLIMITED, TIME, RTL, DELAY, SPEED = 16, 17, 19, 20, 93, 178


def item(command, north=0.0, *, p1=0.0, p2=0.0):
    return Item(3, command, 1, p1, p2, 0.0, 0.0, round((47.397742 + north / 111_195) * 1e7), 85_455_940, 0.0)


def drive(rover, *items):
    """Let a rover begin a mission; item 0 is home."""
    rover.pilot.missions._plans[0] = [item(WAYPOINT), *items]
    assert rover.requests(300) == [ACCEPTED]


def reached(rover):
    return [message.seq for message in rover.said("MISSION_ITEM_REACHED")]


def test_its_places_are_driven_to_and_then_it_stands_armed_in_auto(rover):
    drive(rover, item(WAYPOINT, 10.0), item(WAYPOINT, 25.0))
    rover.until(lambda: rover.pilot.missions.state == COMPLETE, 60.0)
    rover.run(4.0)
    assert reached(rover) == [1, 2]
    assert rover.texts.count("Mission Complete") == 1
    assert rover.body.easing == BRAKED
    assert (rover.mode, rover.pilot.armed) == ("AUTO", True)
    assert rover.body.speed < 0.1
    assert rover.body.north == pytest.approx(25.0, abs=2.0)


def test_its_way_home_is_an_item_like_others(rover):
    drive(rover, item(WAYPOINT, 15.0), item(RTL))
    rover.until(lambda: rover.pilot.missions.state == COMPLETE, 60.0)
    assert rover.mode == "AUTO"
    assert math.hypot(rover.body.north, rover.body.east) < 1.0


@pytest.mark.parametrize(("command", "stays"), [(TIME, 6.0), (WAYPOINT, 6.0)])
def test_a_stay_is_as_long_as_its_item_says(rover, command, stays):
    drive(rover, item(command, 5.0, p1=stays), item(WAYPOINT, 15.0))
    rover.until(lambda: math.hypot(rover.body.north - 5.0, rover.body.east) < 0.35, 30.0)
    assert rover.until(lambda: reached(rover) == [1], 30.0) == pytest.approx(stays, abs=0.3)


def test_a_speed_in_the_mission_is_that_of_what_follows(rover):
    drive(rover, item(SPEED, p1=1.0, p2=1.0), item(WAYPOINT, 30.0))
    rover.run(8.0)
    assert rover.body.speed == pytest.approx(1.0, abs=0.1)


def test_what_only_flying_vehicles_do_is_done_at_once(rover):
    drive(rover, item(22), item(WAYPOINT, 10.0))
    rover.run(0.5)
    assert reached(rover) == [1]
    rover.until(lambda: reached(rover) == [1, 2], 30.0)
