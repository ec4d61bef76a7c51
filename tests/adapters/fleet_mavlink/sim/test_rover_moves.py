"""Manoeuvres of ArduRover 4.6.3: rolling, braking, coasting, and standing."""

import math

import pytest
from pymavlink.dialects.v20 import all as mav

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
