"""Commands of ArduRover 4.6.3: what it answers, and what it does."""

import math

import pytest
from pymavlink.dialects.v20 import all as mav

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
HOLD, GUIDED = 4, 15
AHEAD = 0x0DC7


def behind(metres):
    return (47.397742 - metres / 111_195, 8.545594, 0.0)


def test_it_neither_takes_off_nor_lands_nor_pauses(rover):
    assert rover.requests(22, 0, 0, 0, 0, 0, 0, 10) == [UNSUPPORTED]
    assert rover.requests(21) == [UNSUPPORTED]
    assert rover.requests(193, 0) == [UNSUPPORTED]
    assert rover.requests(176, 0, GUIDED) == [DENIED]
    assert rover.requests(176, 1, 99) == [FAILED]
    assert "No such mode 99" in rover.texts


def test_a_speed_of_zero_is_refused_and_it_drives_on(rover):
    rover.stream(4.0, 3.0, mask=AHEAD)
    assert rover.requests(178, 1, 0, -1) == [FAILED]
    rover.run(1.0)
    assert rover.body.speed > 3.0


def test_it_drives_to_a_place_in_reverse_until_its_mode_changes(rover):
    assert rover.requests(194, 1) == [ACCEPTED]
    assert rover.requests_int(mav.MAV_CMD_DO_REPOSITION, 6, (-1, 1, 0, math.nan), *behind(8)) == [ACCEPTED]
    assert rover.requests(178, 1, 1.0, -1) == [ACCEPTED]
    rover.run(16.0)
    assert rover.body.north == pytest.approx(-8.0, abs=0.7)
    assert abs(math.remainder(rover.body.heading, math.tau)) < 0.1
    rover.requests(176, 1, HOLD)
    rover.requests(176, 1, GUIDED)
    assert rover.requests_int(mav.MAV_CMD_DO_REPOSITION, 6, (-1, 1, 0, math.nan), *behind(0)) == [ACCEPTED]
    rover.run(3.0)
    assert rover.body.along > 0.5


def test_a_speed_is_refused_while_it_has_no_place_to_drive_to(rover):
    assert rover.requests(178, 1, 2.0, -1) == [FAILED]
