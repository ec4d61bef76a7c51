"""GUIDED of ArduRover, as it was recorded."""

import math

import pytest

ACCEPTED = 0
HOLD, GUIDED = 4, 15
AHEAD, KEEP = 0x0DC7, 0x05C7  # masks: velocity; velocity and rate of turn


def test_setpoints_in_hold_are_ignored(rover):
    rover.requests(176, 1, HOLD)
    rover.stream(2.0, 3.0, mask=AHEAD)
    assert rover.body.speed < 0.05
    assert rover.last("HEARTBEAT").system_status == 3


def test_sideways_turns_the_nose_for_ever(rover):
    rover.stream(4.0, 0.0, 1.0, mask=AHEAD)
    turned = math.degrees(rover.body.turn_rate)
    assert turned == pytest.approx(60.0, abs=15.0)


def test_a_rate_of_turn_is_kept_while_it_drives(rover):
    rover.stream(4.0, 2.0, mask=KEEP, rate=0.4)
    assert rover.body.turn_rate == pytest.approx(0.4, abs=0.05)


def test_a_negative_speed_with_a_rate_of_turn_is_driven_in_reverse(rover):
    rover.stream(4.0, -1.0, mask=KEEP)
    assert rover.body.along == pytest.approx(-1.0, abs=0.2)
    assert abs(math.remainder(rover.body.heading, math.tau)) < 0.05
    rover.stream(4.0, -1.0, mask=KEEP, rate=0.4)
    assert rover.body.turn_rate == pytest.approx(0.38, abs=0.05)


def test_without_a_rate_of_turn_it_turns_round_instead(rover):
    rover.stream(3.0, -1.0, mask=AHEAD)
    assert rover.body.along > 0.5


def test_its_wheels_do_not_turn_it_where_it_stands(rover):
    rover.stream(3.0, 0.0, mask=KEEP, rate=0.5)
    assert abs(math.remainder(rover.body.heading, math.tau)) < 0.1
