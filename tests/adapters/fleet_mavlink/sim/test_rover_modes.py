"""Modes of ArduRover 4.6.3: which brake, which coast, and which drive."""

import math

import pytest

from fleet_mavlink.sim.rover_modes import MODES
from fleet_mavlink.sim.rover_moves import BRAKED

ACCEPTED = 0
HOLD, LOITER, GUIDED = 4, 5, 15
AHEAD = 0x0DC7


def stopped_after(it, speed=0.1):
    """Let it stop; return metres and seconds."""
    north, east = it.body.north, it.body.east
    took = it.until(lambda: it.body.speed <= speed, limit=12.0)
    return math.hypot(it.body.north - north, it.body.east - east), took


@pytest.mark.parametrize(
    ("mode", "metres", "seconds"), [(HOLD, 6.9, 6.8), (LOITER, 5.4, 2.8)], ids=["hold", "loiter"]
)
def test_it_brakes_by_a_mode_as_the_recorded_one(rover, mode, metres, seconds):
    rover.stream(4.0, 3.0, mask=AHEAD)
    assert rover.body.speed == pytest.approx(3.45, abs=0.1)
    assert rover.requests(176, 1, mode) == [ACCEPTED]
    went, took = stopped_after(rover)
    assert went == pytest.approx(metres, abs=0.8)
    assert took == pytest.approx(seconds, abs=0.8)


def test_guided_again_is_no_stop(rover):
    rover.stream(4.0, 3.0, mask=AHEAD)
    assert rover.requests(176, 1, GUIDED) == [ACCEPTED]
    rover.run(2.0)
    assert rover.body.speed > 3.0


@pytest.mark.parametrize(
    ("name", "custom", "base", "position", "armable"),
    [
        ("MANUAL", 0, 0x41, False, True),
        ("HOLD", 4, 0x01, False, True),
        ("LOITER", 5, 0x09, True, True),
        ("AUTO", 10, 0x09, True, True),
        ("RTL", 11, 0x09, True, True),
        ("GUIDED", 15, 0x09, True, True),
        ("INITIALISING", 16, 0x01, False, False),
    ],
)
def test_a_mode_has_its_number_and_what_it_needs(name, custom, base, position, armable):
    mode = MODES[name]
    assert (mode.custom, mode.base, mode.position, mode.armable) == (custom, base, position, armable)


@pytest.mark.parametrize("mode", [0, HOLD])
def test_it_coasts_in_hold_and_in_manual_without_a_stick(rover, mode):
    rover.stream(4.0, 3.0, mask=AHEAD)
    rover.requests(176, 1, mode)
    rover.run(1.0)
    assert rover.body.speed == pytest.approx(3.45 * math.exp(-1 / 2.05), abs=0.2)


def test_guided_anew_ends_what_another_mode_did(rover):
    rover.stream(4.0, 3.0, mask=AHEAD)
    rover.requests(176, 1, HOLD)
    rover.requests(176, 1, GUIDED)
    assert rover.body.easing == BRAKED
    rover.run(8.0)
    assert rover.body.speed < 0.1


@pytest.mark.parametrize("mode", [LOITER, 11])
def test_guided_ends_the_way_home_and_stays_where_it_is(rover, mode):
    rover.stream(6.0, 3.0, mask=AHEAD)
    rover.requests(176, 1, mode)
    rover.run(4.0)
    rover.requests(176, 1, GUIDED)
    rover.run(10.0)
    assert rover.body.speed < 0.1
    assert rover.body.north > 4.0  # it was on its way from 14 m


def test_home_is_driven_to_from_wherever_it_is(rover):
    rover.stream(6.0, 3.0, mask=AHEAD)
    rover.requests(176, 1, 11)
    rover.until(lambda: math.hypot(rover.body.north, rover.body.east) < 0.5, limit=60.0)
    rover.run(3.0)
    assert rover.body.speed < 0.1
    assert rover.pilot.armed


def test_a_mode_that_needs_a_position_is_refused_without_one(rover):
    rover.vehicle.set_fault("gps_loss", 1)
    rover.run(15.0)
    assert rover.requests(176, 1, LOITER) == [4]
    assert rover.requests(176, 1, HOLD) == [ACCEPTED]
