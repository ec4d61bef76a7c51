"""Commands of ArduCopter 4.6.3: what it answers, and what it does."""

import math

import pytest
from pymavlink.dialects.v20 import all as mav

ACCEPTED, DENIED, UNSUPPORTED, FAILED, IN_PROGRESS = 0, 2, 3, 4, 5


@pytest.fixture
def ap(bench):
    return bench("ardupilot")


@pytest.fixture
def flying(ap):
    ap.climb()
    return ap


def test_takeoff_needs_guided_and_armed_motors(ap):
    ap.run(0.2)
    assert ap.requests(22, 0, 0, 0, 0, 0, 0, 10) == [FAILED]
    assert ap.requests(400, 1) == [ACCEPTED]
    assert ap.requests(22, 0, 0, 0, 0, 0, 0, 10) == [FAILED]


@pytest.mark.parametrize(("frame", "result"), [(3, ACCEPTED), (6, DENIED), (5, DENIED)])
def test_takeoff_by_command_int_takes_one_frame(ap, frame, result):
    ap.run(0.2)
    ap.set_mode("GUIDED")
    ap.requests(400, 1)
    assert ap.requests_int(22, frame, (0, 0, 0, 0), 0, 0, 10) == [result]


@pytest.mark.parametrize("altitude", [math.nan, 0.0, -5.0])
def test_takeoff_to_no_altitude_fails(ap, altitude):
    ap.run(0.2)
    ap.set_mode("GUIDED")
    ap.requests(400, 1)
    assert ap.requests(22, 0, 0, 0, 0, 0, 0, altitude) == [FAILED]


def test_takeoff_takes_as_long_as_the_real_one(ap):
    ap.run(0.2)
    ap.set_mode("GUIDED")
    ap.requests(400, 1)
    ap.requests(22, 0, 0, 0, 0, 0, 0, 10)
    assert 3.5 < ap.until(lambda: ap.height > 0.5) < 4.7
    assert 4.5 < ap.until(lambda: ap.height > 9.8) < 7.0
    assert ap.mode == "GUIDED"
    assert ap.requests(22, 0, 0, 0, 0, 0, 0, 10) == [FAILED]


def test_reposition_needs_command_int_and_takes_relative_altitude(flying):
    assert flying.requests(192, -1, 1, 0, math.nan, 47.3979, 8.545594, 12) == [UNSUPPORTED]
    assert flying.requests_int(192, 6, (-1, 1, 0, 0), 47.3979, 8.545594, 12) == [ACCEPTED]
    flying.until(lambda: abs(flying.height - 12) < 0.3)


def test_condition_yaw_turns_at_the_rate(flying):
    assert flying.requests(115, 90, 30, 1, 0) == [ACCEPTED]
    assert 2.5 < flying.until(lambda: abs(math.degrees(flying.body.heading) - 90) < 3) < 4.0
    assert flying.requests(115, 400, 30, 1, 0) == [FAILED]


def test_a_plain_disarm_in_flight_is_refused_and_a_forced_one_drops(flying):
    assert flying.requests(400, 0) == [FAILED]
    assert flying.pilot.armed
    assert flying.requests(400, 0, 21196) == [ACCEPTED]
    assert flying.until(lambda: flying.body.grounded) < 2.0


def test_the_released_motor_stop_starts_the_motors_again(flying):
    flying.requests(218, 31, 2)
    flying.run(0.5)
    assert flying.pilot.armed
    assert flying.body.vd > 3
    flying.requests(218, 31, 0)
    flying.until(lambda: abs(flying.height - 10) < 0.3)


def test_reboot_is_refused_in_flight(flying):
    assert flying.requests(246, 1) == [FAILED]


def test_calibration_tells_progress_before_the_result(ap):
    ap.run(0.2)
    assert ap.requests(241, 0, 0, 1) == [IN_PROGRESS, ACCEPTED]


def test_message_rates(ap):
    ap.run(0.2)
    assert ap.requests(511, 30, 20000) == [ACCEPTED]
    assert ap.requests(511, 30, 2500) == [DENIED]
    assert ap.requests(511, 9999, 100000) == [DENIED]
    ap.heard.clear()
    ap.run(10)
    assert 495 <= len(ap.said("ATTITUDE")) <= 505
    ap.requests(511, 30, 0)
    ap.heard.clear()
    ap.run(2)
    assert not ap.said("ATTITUDE")


def test_a_changed_speed_stays_in_force(flying):
    assert flying.requests(178, 1, 2, -1) == [ACCEPTED]
    flying.stream(4, 8.0)
    assert flying.body.speed == pytest.approx(2.0, abs=0.1)


def test_pause_and_continue(flying):
    flying.tell(
        mav.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, 1, 3576, 60, 0, -10, 0, 0, 0, 0, 0, 0, 0, 0
        )
    )
    flying.run(3)
    assert flying.requests(193, 0) == [ACCEPTED]
    flying.run(5)
    assert flying.body.speed < 0.1
    assert flying.requests(193, 1) == [ACCEPTED]
    flying.until(lambda: flying.body.north > 58)


def test_an_unknown_command_is_unsupported(ap):
    ap.run(0.2)
    assert ap.requests(34, 5) == [UNSUPPORTED]
    assert ap.requests(186, 500) == [UNSUPPORTED]
