"""ArduCopter 4.6.3 as it was seen on the wire."""

import math

import pytest
from pymavlink.dialects.v20 import all as mav

ACCEPTED, FAILED = 0, 4


@pytest.fixture
def flying(ap):
    ap.climb()
    return ap


def test_a_mode_set_during_the_start_is_reset(bench):
    ap = bench("ardupilot", ready_after=None)
    ap.run(1.2)
    assert ap.set_mode("GUIDED") == [ACCEPTED]
    assert ap.last("HEARTBEAT").custom_mode == 4
    ap.run(3)
    assert ap.mode == "STABILIZE"


def test_motors_stop_by_themselves_without_a_takeoff(ap):
    ap.run(0.2)
    ap.set_mode("GUIDED")
    ap.requests(400, 1)
    assert 9.5 < ap.until(lambda: not ap.pilot.armed) < 10.5


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
