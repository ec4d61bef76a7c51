"""Commands of PX4 1.16.1: what it answers, and what it does."""

import math

import pytest

from fleet_mavlink.sim.mission_items import Item

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


def test_a_terminated_flight_acknowledges_arming_without_effect(px4):
    px4.run(0.2)
    assert px4.requests(185, 0) == [DENIED]
    assert px4.requests(185, 1) == [ACCEPTED]
    assert px4.requests(400, 1) == [ACCEPTED]
    assert not px4.pilot.armed
    assert px4.requests(22, NAN, 0, 0, NAN, NAN, NAN, 500) == [REJECTED]


def test_a_terminated_flight_falls_and_stays_armed(flying):
    assert flying.requests(185, 2) == [ACCEPTED]
    flying.run(2.0)
    assert flying.body.grounded
    assert flying.last("HEARTBEAT").base_mode & 0x80
    assert flying.mode == "TERMINATION"


def test_arming_is_denied_with_the_reason(bench):
    px4 = bench("px4", ready_after=60.0)
    px4.run(5.0)
    assert px4.requests(400, 1) == [REJECTED]
    assert any(text.startswith("Arming denied: ") for text in px4.texts)
    assert px4.requests(401) == [ACCEPTED]
    assert any(text.startswith("Preflight Fail: ") for text in px4.texts)


def test_checks_are_not_run_in_the_air(flying):
    assert flying.requests(401) == [REJECTED]


def test_a_goal_on_the_ground_is_accepted_and_not_flown(px4):
    px4.run(0.2)
    px4.requests(400, 1)
    assert px4.requests(192, -1, 1, 0, NAN, 47.3980, 8.545594, 500) == [ACCEPTED]
    px4.run(3.0)
    assert (px4.mode, px4.height) == ("LOITER", 0.0)


def test_a_goal_takes_its_speed(flying):
    assert flying.requests(192, 2.0, 1, 0, NAN, 47.3985, 8.545594, 498) == [ACCEPTED]
    flying.run(6.0)
    assert flying.body.speed == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(("speed", "kept"), [(2.0, 2.0), (-1.0, None), (0.0, None)])
def test_a_speed_is_set_and_minus_one_keeps_it(flying, speed, kept):
    assert flying.requests(178, 1, speed, -1) == [ACCEPTED]
    assert flying.pilot.speeds.requested == kept


def test_home_is_set_here_or_at_a_place_and_a_place_without_a_height_is_denied(flying):
    assert flying.requests_int(179, 0, (0, 0, 0, 0), 47.4, 8.5, 500.0) == [ACCEPTED]
    assert flying.pilot.home.place == pytest.approx((47.4, 8.5, 500.0))
    assert flying.requests(179, 0, 0, 0, 0, 47.4, 8.5, NAN) == [DENIED]
    assert flying.requests(179, 1) == [ACCEPTED]
    assert flying.pilot.home.place == pytest.approx((47.397742, 8.545594, 498.0), abs=0.5)


@pytest.mark.parametrize(("number", "results"), [(1, []), (3, []), (0, [DENIED]), (2, [DENIED])])
def test_a_reboot_has_two_numbers(px4, number, results):
    px4.run(0.2)
    assert px4.requests(246, number) == results


def test_the_compass_is_calibrated_by_one_parameter_and_stopped_by_none(px4):
    px4.run(0.2)
    assert px4.requests(241, 1) == [ACCEPTED]  # the gyroscopes: done at once
    assert not px4.vehicle.equipment.compass.calibrating
    assert px4.requests(241, 0, 1) == [ACCEPTED]
    assert px4.vehicle.equipment.compass.calibrating
    assert px4.requests(241) == [ACCEPTED]
    assert not px4.vehicle.equipment.compass.calibrating
    px4.requests(400, 1)
    assert px4.requests(241, 0, 1) == [REJECTED]


def test_a_loaded_mission_is_started_and_arms_it_unless_it_is_not_ready(bench):
    for ready_after, result in ((0.0, ACCEPTED), (60.0, REJECTED)):
        px4 = bench("px4", ready_after=ready_after)
        px4.run(2.0)
        px4.pilot.missions._plans[0] = [Item(3, 22, 1, 0.0, 0.0, 0.0, NAN, 0, 0, 10.0)]
        assert px4.requests(300) == [result]
        assert px4.pilot.armed is (result == ACCEPTED)


def test_landing_and_returning_say_so(flying):
    assert flying.requests(21) == [ACCEPTED]
    assert "Landing at current position\t" in flying.texts
    assert flying.requests(20) == [ACCEPTED]
    assert "Returning to launch\t" in flying.texts
    assert flying.mode == "RTL"


def test_on_the_ground_it_is_disarmed_and_says_so_once(px4):
    px4.run(0.2)
    px4.requests(400, 1)
    assert px4.requests(400, 0) == px4.requests(400, 0) == [ACCEPTED]
    assert px4.texts.count("Disarmed by external command\t") == 1


def test_a_message_that_it_does_not_have_is_denied(px4):
    px4.run(0.2)
    assert px4.requests(512, 9999) == [DENIED]
    assert px4.requests(512, 193) == [DENIED]  # ArduPilot's
