"""Commands of ArduCopter 4.6.3: what it answers, and what it does."""

import math

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.mission_items import Item

ACCEPTED, DENIED, UNSUPPORTED, FAILED, IN_PROGRESS = 0, 2, 3, 4, 5


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


@pytest.mark.parametrize("number", [2.0, -1.0, math.nan])
def test_arming_by_another_number_is_unsupported(ap, number):
    ap.run(0.2)
    assert ap.requests(400, number) == [UNSUPPORTED]


@pytest.mark.parametrize(("code", "result"), [(21196, ACCEPTED), (2989, ACCEPTED), (1, FAILED)])
def test_checks_are_skipped_by_two_numbers(bench, code, result):
    ap = bench("ardupilot", ready_after=60.0)
    ap.run(5.0)
    ap.set_mode("STABILIZE")
    assert ap.requests(400, 1) == [FAILED]
    assert any(text.startswith("Arm: ") for text in ap.texts)
    assert ap.requests(400, 1, code) == [result]


def test_arming_again_is_accepted_and_changes_nothing(flying):
    assert flying.requests(400, 1) == [ACCEPTED]
    assert flying.height == pytest.approx(10, abs=0.3)


@pytest.mark.parametrize(("frame", "height"), [(0, 12.0), (5, 12.0), (3, 500.0), (6, 500.0)])
def test_a_height_is_above_the_sea_or_above_home_by_its_frame(flying, frame, height):
    altitude = 488.0 + height if frame in {0, 5} else 12.0
    assert flying.requests_int(192, frame, (-1, 1, 0, 0), 47.397742, 8.545594, altitude) == [ACCEPTED]
    assert flying.pilot.manoeuvre.down == pytest.approx(-12.0, abs=0.1)


@pytest.mark.parametrize("frame", [1, 2, 7, 8, 10])
def test_a_place_in_another_frame_is_denied(flying, frame):
    assert flying.requests_int(192, frame, (-1, 1, 0, 0), 47.397742, 8.545594, 12.0) == [DENIED]


def test_a_place_changes_to_guided_only_with_its_flag_and_takes_its_speed(flying):
    flying.set_mode("BRAKE")
    assert flying.requests_int(192, 6, (2.0, 0, 0, 0), 47.3981, 8.545594, 10.0) == [DENIED]
    assert flying.mode == "BRAKE"
    assert flying.requests_int(192, 6, (2.0, 1, 0, 0), 47.3981, 8.545594, 10.0) == [ACCEPTED]
    flying.run(5.0)
    assert flying.mode == "GUIDED"
    assert flying.body.speed == pytest.approx(2.0, abs=0.1)


def test_a_place_outside_the_fence_fails(flying):
    flying.set_param("FENCE_RADIUS", 50)
    flying.set_param("FENCE_ENABLE", 1)
    flying.set_param("FENCE_TYPE", 2)
    assert flying.requests_int(192, 6, (-1, 1, 0, 0), 47.3990, 8.545594, 10.0) == [FAILED]


@pytest.mark.parametrize("speed", [0.0, -1.0, math.nan])
def test_no_speed_is_no_speed(flying, speed):
    assert flying.requests(178, 1, speed, -1) == [FAILED]
    assert flying.pilot.speeds.requested is None


def test_a_relative_turn_is_from_where_its_nose_points(flying):
    flying.requests(115, 90, 60, 1, 0)
    flying.run(4.0)
    assert flying.requests(115, 30, 60, -1, 1) == [ACCEPTED]
    flying.run(4.0)
    assert math.degrees(flying.body.heading) == pytest.approx(60, abs=3)


def test_home_is_set_here_or_at_a_place_but_not_nowhere(flying):
    flying.stream(4, 3.0)
    assert flying.requests(179, 1) == [ACCEPTED]
    assert flying.pilot.home.ned()[0] == pytest.approx(flying.body.north, abs=0.5)
    assert flying.requests_int(179, 0, (0, 0, 0, 0), 47.4, 8.5, 500.0) == [ACCEPTED]
    assert flying.pilot.home.place == pytest.approx((47.4, 8.5, 500.0))
    assert flying.requests_int(179, 0, (0, 0, 0, 0), 0.0, 0.0, 500.0) == [FAILED]
    assert flying.requests(179, 0, 0, 0, 0, math.nan, 8.5, 500.0) == [FAILED]


def test_a_mission_is_started_armed_and_whole_only(ap):
    ap.run(0.2)
    assert ap.requests(300) == [DENIED]
    zeros = (0.0, 0.0, 0.0, 0.0)
    ap.pilot.missions._plans[0] = [Item(0, 16, 1, *zeros, 0, 0, 0.0), Item(3, 22, 1, *zeros, 0, 0, 10.0)]
    assert ap.requests(300, 1, 1) == [DENIED]
    assert ap.requests(300) == [FAILED]
    ap.set_mode("GUIDED")
    ap.requests(400, 1)
    assert ap.requests(300) == [ACCEPTED]
    assert ap.mode == "AUTO"


def test_it_is_paused_where_it_moves_by_itself_and_nowhere_else(flying):
    flying.set_mode("BRAKE")
    assert flying.requests(193, 0) == [DENIED]


def test_a_termination_drops_it_and_its_release_is_no_command(flying):
    assert flying.requests(185, 0) == [FAILED]
    assert flying.pilot.armed
    assert flying.requests(185, 1) == [ACCEPTED]
    assert not flying.pilot.armed


@pytest.mark.parametrize(("number", "result"), [(1, ACCEPTED), (3, ACCEPTED), (0, FAILED), (2, FAILED)])
def test_a_reboot_has_two_numbers(ap, number, result):
    ap.run(0.2)
    assert ap.requests(246, number) == [result]


def test_an_unknown_switch_fails(flying):
    assert flying.requests(218, 7, 2) == [FAILED]
    assert flying.height == pytest.approx(10, abs=0.3)


def test_checks_are_run_on_the_ground_and_tell_their_reasons(bench):
    ap = bench("ardupilot", ready_after=60.0)
    ap.run(5.0)
    assert ap.requests(401) == [ACCEPTED]
    assert any(text.startswith("PreArm: ") for text in ap.texts)
    ready = bench("ardupilot")
    ready.climb()
    assert ready.requests(401) == [1]  # temporarily rejected


def test_a_compass_is_not_calibrated_in_the_air(flying):
    assert flying.requests(42424) == [FAILED]
    assert "Disarm to allow calibration" in flying.texts


def test_a_mode_is_changed_with_the_flag_of_a_custom_one_only(ap):
    ap.run(0.2)
    assert ap.requests(176, 0, 4) == [FAILED]
    assert ap.requests(176, 1, 99) == [FAILED]
    assert ap.mode == "STABILIZE"
