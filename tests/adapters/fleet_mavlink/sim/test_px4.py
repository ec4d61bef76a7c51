"""PX4 1.16.1 as it was seen on the wire."""

import math

import pytest
from pymavlink.dialects.v20 import all as mav

ACCEPTED, REJECTED, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
NAN = math.nan


def test_texts_are_withheld_until_a_station_is_heard(bench):
    px4 = bench("px4")
    px4.gcs = False
    px4.run(0.2)
    px4.requests(400, 1)
    px4.run(1)
    assert px4.texts == []
    px4.gcs = True
    px4.run(1.5)
    assert px4.texts == ["Armed by external command\t"]


def test_takeoff_takes_as_long_as_the_real_one_and_ends_in_loiter(px4):
    px4.run(0.2)
    px4.requests(22, NAN, 0, 0, NAN, NAN, NAN, 498)
    px4.requests(400, 1)
    assert 4.5 < px4.until(lambda: px4.height > 0.5) < 5.7
    assert px4.mode == "TAKEOFF"
    assert px4.pilot.land_detector.state() == 3
    assert 6 < px4.until(lambda: px4.height > 9.7) < 9.5
    px4.run(1)
    assert px4.mode == "LOITER"
    assert px4.pilot.land_detector.state() == 2
    px4.run(2)
    assert px4.height == pytest.approx(10, abs=0.1)


def test_takeoff_at_latitude_0_never_leaves_the_ground(px4):
    px4.run(0.2)
    assert px4.requests(22, 0, 0, 0, 0, 0, 0, 498) == [ACCEPTED]
    assert px4.requests(400, 1) == [ACCEPTED]
    assert px4.mode == "TAKEOFF"
    px4.until(lambda: not px4.pilot.armed, 12)
    assert px4.height == 0


def test_takeoff_with_a_relative_altitude_only_hops(px4):
    px4.run(0.2)
    px4.requests(22, NAN, 0, 0, NAN, NAN, NAN, 10)
    px4.requests(400, 1)
    px4.run(15)
    assert 0.3 < px4.height < 1.0
    assert "Already higher than takeoff altitude\t" in px4.texts


def test_takeoff_without_an_altitude_climbs_the_default(px4):
    px4.run(0.2)
    px4.requests(22, NAN, 0, 0, NAN, NAN, NAN, NAN)
    px4.requests(400, 1)
    px4.run(15)
    assert px4.height == pytest.approx(2.5, abs=0.3)


def test_takeoff_while_flying_climbs_on(flying):
    assert flying.requests(22, NAN, 0, 0, NAN, NAN, NAN, 503) == [ACCEPTED]
    flying.until(lambda: abs(flying.height - 15) < 0.3)
    flying.until(lambda: flying.mode == "LOITER")


def test_motors_stop_by_themselves_without_a_takeoff(px4):
    px4.run(0.2)
    px4.requests(400, 1)
    assert 10.6 < px4.until(lambda: not px4.pilot.armed) < 11.6


def test_a_mode_is_acknowledged_twice(flying):
    assert flying.set_mode("OFFBOARD") == [ACCEPTED, REJECTED]
    assert flying.mode == "LOITER"
    assert any("Offboard is currently not available" in text for text in flying.texts)


def test_an_unknown_mode_is_accepted_twice_and_changes_nothing(flying):
    assert flying.requests(176, 1, 99) == [ACCEPTED, ACCEPTED]
    assert flying.mode == "LOITER"


def test_set_mode_gets_one_acknowledgement(px4):
    px4.run(0.2)
    px4.tell(mav.MAVLink_set_mode_message(1, 1, 0x03040000))
    px4.run(0.1)
    assert [ack.command for ack in px4.said("COMMAND_ACK")] == [176]


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


def test_land_disarms_and_goes_back_to_the_mode_chosen_last(offboard):
    offboard.requests(21)
    assert 12 < offboard.until(lambda: not offboard.pilot.armed) < 24
    assert [text.strip() for text in offboard.texts[-2:]] == ["Landing detected", "Disarmed by landing"]
    assert offboard.mode == "OFFBOARD"


def test_rtl_comes_home(flying):
    flying.requests(192, -1, 1, 0, NAN, 47.397922, 8.545594, 498)
    flying.until(lambda: flying.body.north > 19)
    assert flying.requests(20) == [ACCEPTED]
    assert 30 < flying.until(lambda: not flying.pilot.armed, 80) < 70
    assert abs(flying.body.north) < 1
    assert flying.mode == "LOITER"


def test_a_plain_disarm_in_flight_is_refused(flying):
    assert flying.requests(400, 0) == [REJECTED]
    assert "Disarming denied: not landed\t" in flying.texts


def test_a_forced_disarm_drops_and_moves_home(flying):
    assert flying.requests(400, 0, 21196) == [ACCEPTED]
    assert abs(flying.pilot.home.height()) < 0.5
    assert flying.until(lambda: flying.body.grounded) < 3


def test_reboot_is_refused_in_flight(flying):
    assert flying.requests(246, 1) == [DENIED]


def test_a_burst_of_commands_loses_acknowledgements(px4):
    px4.run(0.2)
    for _ in range(20):
        px4.tell(mav.MAVLink_command_long_message(1, 1, 520, 0, 1, 0, 0, 0, 0, 0, 0))
    px4.run(0.1)
    assert len(px4.said("COMMAND_ACK")) == 4
    assert len(px4.said("AUTOPILOT_VERSION")) == 20


def test_commands_for_another_component_get_no_answer(px4):
    px4.run(0.2)
    px4.tell(mav.MAVLink_command_long_message(1, 42, 520, 0, 1, 0, 0, 0, 0, 0, 0))
    px4.run(0.1)
    assert not px4.said("COMMAND_ACK")


def test_the_answer_goes_to_the_asker(px4):
    px4.run(0.2)
    px4.tell(mav.MAVLink_command_long_message(1, 1, 520, 0, 1, 0, 0, 0, 0, 0, 0), system=245, component=191)
    px4.run(0.1)
    ack = px4.last("COMMAND_ACK")
    assert (ack.target_system, ack.target_component) == (245, 191)


def test_rates_come_unasked_and_can_be_changed(px4):
    px4.run(0.2)
    px4.heard.clear()
    px4.run(10)
    assert 480 <= len(px4.said("ATTITUDE")) <= 505
    assert px4.requests(511, 30, 100000) == [ACCEPTED]
    assert px4.requests(511, 9999, 100000) == [FAILED]
    px4.heard.clear()
    px4.run(10)
    assert 98 <= len(px4.said("ATTITUDE")) <= 102


def test_a_lost_station_holds_and_returns_when_configured(flying):
    flying.set_param("NAV_DLL_ACT", 2)
    flying.set_param("COM_DL_LOSS_T", 5)
    flying.gcs = False
    flying.run(8)
    assert flying.pilot.failsafe == "gcs"
    assert flying.mode == "LOITER"
    flying.run(5)
    assert flying.mode == "RTL"
    flying.gcs = True
    flying.run(2)
    assert flying.mode == "RTL"


def test_a_critical_battery_holds_and_returns_and_the_user_overrules(flying):
    flying.vehicle.set_fault("low_battery", 6)
    flying.run(1)
    assert flying.mode == "LOITER"
    flying.run(5)
    assert flying.mode == "RTL"
    assert flying.set_mode("LOITER") == [ACCEPTED, ACCEPTED]
    flying.run(6)
    assert flying.mode == "LOITER"


def test_an_emptying_battery_lands_in_the_end(flying):
    flying.vehicle.set_fault("low_battery", 4)
    flying.run(6)
    assert flying.mode == "LAND"


def test_without_satellites_it_lands_and_loiter_is_refused(flying):
    flying.vehicle.set_fault("gps_loss", 1)
    flying.run(6)
    assert flying.mode == "LAND"
    assert flying.set_mode("LOITER") == [ACCEPTED, REJECTED]


def test_a_pilot_takes_over_and_holds(offboard):
    offboard.vehicle.set_fault("pilot_takeover", 1)
    offboard.stream(3, 2.0)
    assert offboard.mode == "POSCTL"
    assert offboard.height == pytest.approx(10, abs=0.3)
    assert offboard.body.speed < 0.1


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
