"""The pilot's remote control lost: what each autopilot does by itself."""

import pytest
from pymavlink.dialects.v20 import all as mav

ACCEPTED, FAILED = 0, 4
RECEIVER = mav.MAV_SYS_STATUS_SENSOR_RC_RECEIVER


@pytest.fixture
def ardupilot(bench):
    made = bench("ardupilot")
    made.climb()
    return made


@pytest.fixture
def px4(bench):
    made = bench("px4")
    made.set_param("COM_RC_IN_MODE", 0)
    made.climb()
    return made


def test_ardupilot_returns_at_once_and_stays_in_it_when_the_control_is_back(ardupilot):
    ardupilot.vehicle.set_fault("rc_loss", 1)
    ardupilot.run(0.1)
    assert ardupilot.mode == "RTL"
    ardupilot.run(1.5)
    assert ardupilot.last("HEARTBEAT").system_status == mav.MAV_STATE_CRITICAL
    ardupilot.vehicle.set_fault("rc_loss", None)
    ardupilot.run(1)
    assert ardupilot.texts[-2:] == ["Radio Failsafe", "Radio Failsafe Cleared"]
    assert ardupilot.mode == "RTL"


def test_ardupilot_obeys_a_new_mode_while_the_control_is_lost(ardupilot):
    ardupilot.vehicle.set_fault("rc_loss", 1)
    ardupilot.run(1)
    assert ardupilot.set_mode("BRAKE") == [ACCEPTED]
    ardupilot.run(3)
    assert ardupilot.mode == "BRAKE"


@pytest.mark.parametrize(
    ("values", "mode"),
    [
        ({"FS_THR_ENABLE": 0}, "GUIDED"),
        ({"FS_THR_ENABLE": 2}, "RTL"),
        ({"FS_THR_ENABLE": 3}, "LAND"),
        ({"FS_OPTIONS": 4}, "GUIDED"),
    ],
)
def test_ardupilots_parameters_say_what_it_does(ardupilot, values, mode):
    for name, value in values.items():
        ardupilot.set_param(name, value)
    ardupilot.vehicle.set_fault("rc_loss", 1)
    ardupilot.run(1)
    assert ardupilot.mode == mode
    is_reported = any(text == "Radio Failsafe - Continuing Guided Mode" for text in ardupilot.texts)
    assert is_reported == ("FS_OPTIONS" in values)


def test_ardupilot_without_a_control_is_not_armed_unless_it_is_forced(bench):
    ap = bench("ardupilot", faults={"rc_loss": 1.0})
    ap.run(0.2)
    ap.set_mode("GUIDED")
    assert ap.requests(400, 1) == [FAILED]
    assert "Arm: Radio failsafe on" in ap.texts
    ap.set_param("FS_THR_ENABLE", 0)
    ap.run(1)
    assert ap.requests(400, 1) == [FAILED]
    assert ap.requests(400, 1, 21196) == [ACCEPTED]


def test_ardupilot_disarms_on_the_ground(bench):
    ap = bench("ardupilot")
    ap.run(0.2)
    ap.set_mode("GUIDED")
    ap.requests(400, 1)
    ap.vehicle.set_fault("rc_loss", 1)
    ap.run(0.2)
    assert not ap.pilot.armed
    assert ap.texts[-1] == "Radio Failsafe - Disarming"


def test_ardupilot_tells_the_receivers_health(ardupilot):
    present, _, healthy = ardupilot.pilot.status.sensors()
    assert present & healthy & RECEIVER
    ardupilot.vehicle.set_fault("rc_loss", 1)
    ardupilot.run(0.1)
    present, _, healthy = ardupilot.pilot.status.sensors()
    assert present & RECEIVER
    assert not healthy & RECEIVER


def test_px4_holds_and_then_returns(px4):
    px4.vehicle.set_fault("rc_loss", 1)
    px4.run(0.3)
    assert px4.pilot.failsafe == ""
    px4.run(1)
    assert (px4.pilot.failsafe, px4.mode) == ("radio", "LOITER")
    assert px4.texts[-1].strip() == "Failsafe activated"
    px4.run(5)
    assert px4.mode == "RTL"
    px4.vehicle.set_fault("rc_loss", None)
    px4.run(1)
    assert (px4.pilot.failsafe, px4.mode) == ("", "RTL")


def test_px4_obeys_a_new_mode_while_the_control_is_lost(px4):
    px4.vehicle.set_fault("rc_loss", 1)
    px4.run(7)
    assert px4.set_mode("LOITER")[-1] == ACCEPTED
    px4.run(7)
    assert px4.mode == "LOITER"


@pytest.mark.parametrize(
    ("values", "mode"),
    [
        ({"NAV_RCL_ACT": 0}, "LOITER"),
        ({"NAV_RCL_ACT": 3}, "LAND"),
        ({"COM_RCL_EXCEPT": 2}, "LOITER"),
        ({"COM_RCL_EXCEPT": 4}, "RTL"),
    ],
)
def test_px4s_parameters_say_what_it_does(px4, values, mode):
    for name, value in values.items():
        px4.set_param(name, value)
    px4.vehicle.set_fault("rc_loss", 1)
    px4.run(7)
    assert px4.mode == mode


def test_px4_that_has_no_control_does_not_miss_it(bench):
    made = bench("px4")
    made.climb()
    made.vehicle.set_fault("rc_loss", 1)
    made.run(10)
    assert made.mode == "LOITER"
    assert not made.pilot.status.sensors()[0] & RECEIVER


def test_px4_that_was_armed_without_its_control_does_not_miss_it(bench):
    made = bench("px4", faults={"rc_loss": 1.0})
    made.set_param("COM_RC_IN_MODE", 0)
    made.climb()
    made.run(10)
    assert made.mode == "LOITER"
    made.vehicle.set_fault("rc_loss", None)
    made.run(1)
    made.vehicle.set_fault("rc_loss", 1)
    made.run(7)
    assert made.mode == "RTL"
