"""ArduCopter 4.6.3 as it was seen on the wire."""

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


def test_only_heartbeats_and_texts_come_unasked(ap):
    ap.run(30)
    assert {m.get_type() for m in ap.heard} == {"HEARTBEAT", "STATUSTEXT", "HOME_POSITION"}
    assert 29 <= len(ap.said("HEARTBEAT")) <= 32


def test_the_ekf_report_shows_a_usable_position(bench):
    ap = bench("ardupilot", ready_after=10.0)
    ap.run(1)
    ap.requests(512, 193)
    assert ap.last("EKF_STATUS_REPORT").flags == 0xA7
    ap.run(10)
    ap.requests(512, 193)
    assert ap.last("EKF_STATUS_REPORT").flags == 0x33F


def test_a_mode_set_during_the_start_is_reset(bench):
    ap = bench("ardupilot", ready_after=None)
    ap.run(1.2)
    assert ap.set_mode("GUIDED") == [ACCEPTED]
    assert ap.last("HEARTBEAT").custom_mode == 4
    ap.run(3)
    assert ap.mode == "STABILIZE"


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


def test_motors_stop_by_themselves_without_a_takeoff(ap):
    ap.run(0.2)
    ap.set_mode("GUIDED")
    ap.requests(400, 1)
    assert 9.5 < ap.until(lambda: not ap.pilot.armed) < 10.5


def test_reposition_needs_command_int_and_takes_relative_altitude(flying):
    assert flying.requests(192, -1, 1, 0, math.nan, 47.3979, 8.545594, 12) == [UNSUPPORTED]
    assert flying.requests_int(192, 6, (-1, 1, 0, 0), 47.3979, 8.545594, 12) == [ACCEPTED]
    flying.until(lambda: abs(flying.height - 12) < 0.3)


def test_condition_yaw_turns_at_the_rate(flying):
    assert flying.requests(115, 90, 30, 1, 0) == [ACCEPTED]
    assert 2.5 < flying.until(lambda: abs(math.degrees(flying.body.heading) - 90) < 3) < 4.0
    assert flying.requests(115, 400, 30, 1, 0) == [FAILED]


@pytest.mark.parametrize("mode", ["LOITER", "ALT_HOLD", "POSHOLD"])
def test_manual_modes_come_down_without_a_stick(flying, mode):
    flying.set_mode(mode)
    flying.run(2.5)
    assert flying.height < 6


def test_brake_holds(flying):
    flying.stream(2, 3.0)
    flying.set_mode("BRAKE")
    flying.run(3)
    assert flying.body.speed < 0.1
    assert flying.height == pytest.approx(10, abs=0.3)


def test_land_touches_down_and_disarms(flying):
    assert flying.requests(21) == [ACCEPTED]
    assert 15 < flying.until(lambda: not flying.pilot.armed) < 30
    assert flying.mode == "LAND"
    assert "Disarming motors" in flying.texts


def test_rtl_comes_home_and_disarms(flying):
    flying.stream(5, 4.0)
    assert flying.requests(20) == [ACCEPTED]
    flying.until(lambda: flying.height > 14.5)
    flying.until(lambda: not flying.pilot.armed, 70)
    assert math.hypot(flying.body.north, flying.body.east) < 1.0


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


def test_a_reboot_forgets_the_rates_and_keeps_the_parameters(ap):
    ap.run(1)
    ap.set_param("RTL_ALT", 2000)
    ap.requests(511, 30, 100000)
    assert ap.requests(246, 1) == [ACCEPTED]
    ap.heard.clear()
    ap.run(5)
    assert not ap.said("ATTITUDE")
    assert ap.pilot.params["RTL_ALT"] == 2000
    assert ap.pilot.uptime.ms < 4200


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


def test_data_streams_can_be_asked_for(ap):
    ap.run(0.2)
    ap.tell(mav.MAVLink_request_data_stream_message(1, 1, 0, 4, 1))
    ap.run(10)
    assert 38 <= len(ap.said("ATTITUDE")) <= 42
    assert 38 <= len(ap.said("SYS_STATUS")) <= 42


def test_set_mode_gets_no_acknowledgement(ap):
    ap.run(0.2)
    ap.tell(mav.MAVLink_set_mode_message(1, 1, 4))
    assert ap.mode == "GUIDED"
    assert not ap.said("COMMAND_ACK")


def test_commands_for_other_components_are_obeyed_but_not_for_other_systems(ap):
    ap.run(0.2)
    assert [
        m.get_type() for m in ap.tell(mav.MAVLink_command_long_message(1, 42, 520, 0, 1, 0, 0, 0, 0, 0, 0))
    ] == [
        "AUTOPILOT_VERSION",
        "COMMAND_ACK",
    ]
    assert ap.tell(mav.MAVLink_command_long_message(9, 1, 520, 0, 1, 0, 0, 0, 0, 0, 0)) == []


def test_gcs_failsafe_is_off_by_default_and_returns_when_it_is_on(flying):
    flying.gcs = False
    flying.run(10)
    assert flying.mode == "GUIDED"
    flying.set_param("FS_GCS_ENABLE", 1)
    flying.run(1)
    assert flying.mode == "RTL"
    flying.run(1)
    assert flying.last("HEARTBEAT").system_status == mav.MAV_STATE_CRITICAL
    flying.gcs = True
    flying.run(2)
    assert "GCS Failsafe Cleared" in flying.texts
    assert flying.mode == "RTL"


def test_only_the_configured_station_counts_for_the_gcs_failsafe(flying):
    flying.set_param("FS_GCS_ENABLE", 1)
    flying.gcs = False
    for _ in range(8):
        flying.tell(mav.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3), system=245)
        flying.run(1)
    assert flying.mode == "RTL"


def test_a_low_battery_only_warns_unless_configured_otherwise(flying):
    flying.vehicle.set_fault("low_battery", 10)
    flying.run(12)
    assert flying.mode == "GUIDED"
    assert any(text.startswith("Battery 1 is low") for text in flying.texts)


def test_a_low_battery_returns_when_configured(flying):
    flying.set_param("BATT_FS_LOW_ACT", 2)
    flying.set_param("BATT_LOW_TIMER", 3)
    flying.vehicle.set_fault("low_battery", 10)
    flying.run(3.5)
    assert flying.mode == "RTL"
    assert flying.set_mode("GUIDED") == [ACCEPTED]


def test_without_satellites_it_lands_after_8_seconds(flying):
    flying.vehicle.set_fault("gps_loss", 1)
    flying.run(7.8)
    assert flying.mode == "GUIDED"
    flying.run(0.6)
    assert flying.mode == "LAND"
    assert flying.texts[-2:] == ["EKF variance", "EKF Failsafe: changed to LAND Mode"]
    assert flying.set_mode("GUIDED") == [FAILED]
    flying.vehicle.set_fault("gps_loss", None)
    flying.run(1.0)
    assert "EKF Failsafe Cleared" in flying.texts
    assert flying.mode == "LAND"
    assert flying.set_mode("GUIDED") == [ACCEPTED]


def test_auto_without_a_mission_is_refused_in_flight(flying):
    assert flying.set_mode("AUTO") == [FAILED]
    assert "Mode change to AUTO failed: init failed" in flying.texts


def test_a_pilot_takes_over_and_holds(flying):
    flying.stream(2, 2.0)
    flying.vehicle.set_fault("pilot_takeover", 1)
    flying.run(4)
    assert flying.last("HEARTBEAT").custom_mode == 5
    assert flying.height == pytest.approx(10, abs=0.3)
    flying.stream(2, 2.0)
    assert flying.body.speed < 0.1


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


def test_the_mode_that_it_has_is_not_entered_again(flying):
    flying.stream(1, 2.0)
    assert flying.set_mode("GUIDED") == [ACCEPTED]
    flying.run(1)
    assert flying.body.speed > 1.5


@pytest.mark.parametrize(("mode", "seconds"), [("LAND", 2.0), ("RTL", 11.0)])
def test_a_landing_on_the_ground_does_not_take_off(ap, mode, seconds):
    ap.run(0.2)
    ap.set_mode("GUIDED")
    ap.requests(400, 1)
    assert ap.set_mode(mode) == [ACCEPTED]
    ap.until(lambda: not ap.pilot.armed, limit=seconds)
    assert ap.body.grounded
