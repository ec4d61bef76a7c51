"""Commands of PX4 1.16.1: what it answers, and what it does."""

import math

import pytest

ACCEPTED, REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3
NAN = math.nan


def test_a_mode_is_acknowledged_twice(flying):
    assert flying.set_mode("OFFBOARD") == [ACCEPTED, REJECTED]
    assert flying.mode == "LOITER"
    assert any("Offboard is currently not available" in text for text in flying.texts)


def test_an_unknown_mode_is_accepted_twice_and_changes_nothing(flying):
    assert flying.requests(176, 1, 99) == [ACCEPTED, ACCEPTED]
    assert flying.mode == "LOITER"


def test_reposition_takes_every_altitude_above_sea_level(flying):
    assert flying.requests_int(192, 6, (-1, 1, 0, NAN), 47.397742, 8.545594, 15) == [ACCEPTED]
    flying.until(lambda: flying.body.grounded)
    assert any("Landing detected" in text for text in flying.texts)


def test_reposition_keeps_what_is_not_a_number_and_turns_in_radians(flying):
    assert flying.requests(192, -1, 1, 0, math.pi / 2, NAN, NAN, 500) == [ACCEPTED]
    flying.until(lambda: abs(flying.height - 12) < 0.2)
    flying.run(2)
    assert math.degrees(flying.body.heading) == pytest.approx(90, abs=2)
    assert flying.body.north == pytest.approx(0, abs=0.3)


def test_reposition_without_the_mode_flag_and_condition_yaw_are_unsupported(flying):
    assert flying.requests(192, -1, 0, 0, NAN, NAN, NAN, 500) == [UNSUPPORTED]
    assert flying.requests(115, 90, 30, 1) == [UNSUPPORTED]
    assert flying.requests(193, 0) == [UNSUPPORTED]


def test_change_altitude(flying):
    assert flying.requests(186, 495) == [ACCEPTED]
    flying.until(lambda: abs(flying.height - 7) < 0.2)


def test_a_plain_disarm_in_flight_is_refused(flying):
    assert flying.requests(400, 0) == [REJECTED]
    assert "Disarming denied: not landed\t" in flying.texts


def test_a_forced_disarm_drops_and_moves_home(flying):
    assert flying.requests(400, 0, 21196) == [ACCEPTED]
    assert abs(flying.pilot.home.height()) < 0.5
    assert flying.until(lambda: flying.body.grounded) < 3


def test_reboot_is_refused_in_flight(flying):
    assert flying.requests(246, 1) == [DENIED]


def test_mission_start_arms_by_itself(px4):
    px4.run(0.2)
    assert px4.requests(300) == [DENIED]


def test_an_orbit_is_accepted_and_shown(px4):
    px4.run(0.2)
    assert px4.requests(34, 5) == [ACCEPTED]
    px4.run(1.1)
    assert px4.last("HEARTBEAT").custom_mode == 0x01030000


def test_nobody_answers_the_injection_of_a_failure(px4):
    px4.run(0.2)
    assert px4.requests(420, 1) == []


def test_a_pause_and_a_turn_are_unsupported(flying):
    assert flying.requests(193, 0) == [UNSUPPORTED]
    assert flying.requests(115, 90) == [UNSUPPORTED]


def test_arming_by_another_number_is_unsupported(px4):
    px4.run(0.2)
    assert px4.requests(400, 2) == [UNSUPPORTED]
