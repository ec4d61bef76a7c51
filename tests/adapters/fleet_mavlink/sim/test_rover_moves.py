"""Manoeuvres of ArduRover 4.6.3: rolling, braking, coasting, and standing."""

import math
from types import SimpleNamespace

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.physics import Agility, MotionTarget
from fleet_mavlink.sim.rover_moves import DISARMED, HELD, TIMED_OUT, Coast, DriveAtSpeed, DriveToPosition
from fleet_mavlink.sim.rover_physics import WheeledBody

ACCEPTED = 0
RTL = 11
AHEAD = 0x0DC7


def stopped_after(it, speed=0.1):
    """Let it stop; return metres and seconds."""
    north, east = it.body.north, it.body.east
    took = it.until(lambda: it.body.speed <= speed, limit=12.0)
    return math.hypot(it.body.north - north, it.body.east - east), took


def test_it_stops_by_itself_three_seconds_after_the_last_setpoint(rover):
    rover.stream(4.0, 3.0, mask=AHEAD)
    metres, seconds = stopped_after(rover)
    assert "target not received last 3secs, stopping" in rover.texts
    assert metres == pytest.approx(13.2, abs=1.0)
    assert seconds == pytest.approx(8.0, abs=1.5)


def test_a_disarmed_one_coasts(rover):
    rover.stream(4.0, 2.0, mask=AHEAD)
    assert rover.requests(400, 0) == [ACCEPTED]
    metres, _ = stopped_after(rover)
    assert metres == pytest.approx(3.8, abs=0.8)


def test_it_drives_to_a_place_and_home_and_stays_armed(rover):
    place = (47.397742 + 20 / 111_195, 8.545594, 0.0)
    assert rover.requests_int(mav.MAV_CMD_DO_REPOSITION, 6, (-1, 1, 0, math.nan), *place) == [ACCEPTED]
    rover.until(lambda: rover.body.north > 19.0)
    assert rover.requests(20) == [ACCEPTED]
    rover.until(lambda: "Reached destination" in rover.texts)
    assert rover.pilot.armed
    assert rover.mode == "RTL"


def pilot_of(**body):
    said = []
    speeds = SimpleNamespace(cruise=3.0, climb=1.0, sink=1.0, yaw_follows_course=True)
    return SimpleNamespace(
        body=WheeledBody(**body),
        time=0.0,
        reversed=False,
        speeds=speeds,
        agility=Agility(1.15, 1.0, 1.05),
        said=said,
        say=lambda severity, text: said.append((severity, text)),
    )


@pytest.mark.parametrize("easing", [0.0, HELD, DISARMED])
def test_coasting_is_no_motion_with_its_time_constant(easing):
    pilot = pilot_of()
    assert Coast(easing).aim(pilot) == MotionTarget()
    assert pilot.body.easing == easing
    assert Coast(easing).in_air_state == 0


@pytest.mark.parametrize(("speed", "heading"), [(2.0, 0.0), (2.0, math.pi / 2), (-1.0, 0.0)])
def test_it_rolls_along_its_nose_faster_than_it_was_asked_to_and_in_reverse(speed, heading):
    pilot = pilot_of(heading=heading)
    aim = DriveAtSpeed(speed, None, 0.25, until=1.0).aim(pilot)
    ahead = 1.15 * speed
    assert (aim.vn, aim.ve) == pytest.approx((ahead * math.cos(heading), ahead * math.sin(heading)))
    assert (aim.turn_rate, aim.heading, pilot.body.backwards) == (0.25, None, speed < 0)


def test_a_heading_that_is_given_is_driven_to():
    aim = DriveAtSpeed(2.0, math.pi / 2, 0.0, until=1.0).aim(pilot_of())
    assert (aim.vn, aim.ve, aim.heading) == pytest.approx((0.0, 2.3, math.pi / 2))


def test_an_old_setpoint_stops_it_with_one_warning():
    pilot = pilot_of()
    roll = DriveAtSpeed(2.0, None, 0.0, until=3.0)
    pilot.time = 3.0
    assert roll.aim(pilot).vn > 0.0
    pilot.time = 3.01
    assert [roll.aim(pilot) for _ in range(3)] == [MotionTarget()] * 3
    assert pilot.said == [(4, "target not received last 3secs, stopping")]
    assert pilot.body.easing == TIMED_OUT


@pytest.mark.parametrize(("away", "done"), [(0.34, True), (0.36, False)])
def test_a_place_is_reached_within_thirty_five_centimetres(away, done):
    pilot = pilot_of(north=away)
    drive = DriveToPosition(0.0, 0.0)
    aim = drive.aim(pilot)
    assert drive.done is done
    assert (aim == MotionTarget()) is done


def test_a_place_that_was_reached_stays_so_and_is_driven_to_in_reverse_if_it_is_told_so():
    pilot = pilot_of(north=0.1)
    drive = DriveToPosition(0.0, 0.0)
    drive.aim(pilot)
    pilot.body.north = 5.0
    assert drive.aim(pilot) == MotionTarget()
    pilot.reversed = True
    DriveToPosition(0.0, 0.0).aim(pilot)
    assert pilot.body.backwards
