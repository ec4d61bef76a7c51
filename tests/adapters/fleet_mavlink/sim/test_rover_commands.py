"""Commands of ArduRover 4.6.3: what it answers, and what it does."""

import math

import pytest
from pymavlink.dialects.v20 import all as mav

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
HOLD, LOITER, GUIDED = 4, 5, 15
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


def place(north):
    return (47.397742 + north / 111_195, 8.545594, 0.0)


def test_it_is_armed_with_its_reasons_or_by_force(bench):
    it = bench("ardupilot", vehicle="rover", ready_after=60.0)
    it.run(5.0)
    it.requests(176, 1, LOITER)
    assert it.requests(400, 1) == [FAILED]
    assert any(text.startswith("Arm: ") for text in it.texts)
    assert it.requests(400, 1, 21196) == [ACCEPTED]
    assert "Throttle armed" in it.texts


def test_arming_again_is_accepted_and_does_not_stop_it(rover):
    rover.stream(3.0, 3.0, mask=AHEAD)
    assert rover.requests(400, 1) == [ACCEPTED]
    assert rover.body.speed > 2.5


def test_it_is_disarmed_while_it_drives_and_says_so_once(rover):
    rover.stream(3.0, 3.0, mask=AHEAD)
    assert rover.requests(400, 0) == rover.requests(400, 0) == [ACCEPTED]
    assert rover.texts.count("Throttle disarmed") == 1


def test_a_place_needs_guided_or_the_flag_that_leads_to_it(rover):
    rover.requests(176, 1, HOLD)
    assert rover.requests_int(192, 6, (-1, 0, 0, math.nan), *place(10.0)) == [DENIED]
    assert rover.mode == "HOLD"
    assert rover.requests_int(192, 6, (-1, 1, 0, math.nan), *place(10.0)) == [ACCEPTED]
    assert rover.mode == "GUIDED"


def test_a_place_is_not_taken_from_a_long_command(rover):
    assert rover.requests(192, -1, 1, 0, math.nan, *place(10.0)) == [DENIED]


def test_a_speed_is_taken_for_the_place_it_drives_to(rover):
    rover.requests_int(192, 6, (-1, 1, 0, math.nan), *place(40.0))
    assert rover.requests(178, 1, 1.5, -1) == [ACCEPTED]
    rover.run(6.0)
    assert rover.body.speed == pytest.approx(1.5, abs=0.2)


def test_a_mission_is_started_armed_and_loaded_only(rover):
    assert rover.requests(300) == [FAILED]
    rover.requests(400, 0)
    assert rover.requests(300) == [FAILED]
    assert rover.mode == "GUIDED"


def test_the_reverse_is_switched_off_by_anything_but_one(rover):
    for value, reversed_ in ((1, True), (0, False), (1, True), (2, False)):
        assert rover.requests(194, value) == [ACCEPTED]
        assert rover.pilot.reversed is reversed_
