"""Fail-safes of ArduRover 4.6.3: FS_ACTION after FS_TIMEOUT, and never out of HOLD."""

import pytest

HOLD = 4
KEEP = 0x05C7


def test_a_station_that_falls_silent_makes_it_act_after_its_time(rover):
    rover.set_param("FS_GCS_ENABLE", 1)
    rover.set_param("FS_ACTION", 1)
    rover.stream(2.0, 2.0, mask=KEEP)
    rover.gcs = False
    rover.until(lambda: "GCS Failsafe" in rover.texts, limit=5.0)
    assert rover.mode == "RTL"


def test_a_lost_position_makes_it_hold(rover):
    rover.stream(2.0, 2.0, mask=KEEP)
    rover.set_param("SIM_GPS_DISABLE", 1)
    rover.until(lambda: "EKF failsafe" in rover.texts, limit=20.0)
    assert rover.mode == "HOLD"


@pytest.mark.parametrize(
    ("action", "mode"), [(0, "GUIDED"), (1, "RTL"), (2, "HOLD"), (3, "RTL"), (4, "HOLD")]
)
def test_a_lost_station_is_acted_on_by_its_parameter(rover, action, mode):
    rover.set_param("FS_GCS_ENABLE", 1)
    rover.set_param("FS_ACTION", action)
    rover.stream(1.0, 2.0, mask=KEEP)
    rover.gcs = False
    rover.run(4.5)
    assert rover.mode == mode
    assert rover.texts.count("GCS Failsafe") == 1


def test_it_is_off_unless_it_is_enabled(rover):
    rover.gcs = False
    rover.run(10.0)
    assert "GCS Failsafe" not in rover.texts


@pytest.mark.parametrize("seconds", [1.5, 5.0])
def test_it_acts_after_its_time_and_not_before(rover, seconds):
    rover.set_param("FS_GCS_ENABLE", 1)
    rover.set_param("FS_TIMEOUT", seconds)
    rover.lose_station()
    took = rover.until(lambda: "GCS Failsafe" in rover.texts, limit=10.0)
    assert took == pytest.approx(seconds + 0.5, abs=0.25)


def test_in_hold_it_does_not_act_and_a_station_that_comes_back_clears_what_was_told(rover):
    rover.set_param("FS_GCS_ENABLE", 1)
    rover.set_param("FS_ACTION", 1)
    rover.requests(176, 1, HOLD)
    rover.gcs = False
    rover.run(6.0)
    assert (rover.mode, "GCS Failsafe" in rover.texts) == ("HOLD", False)
    rover.requests(176, 1, 15)
    rover.run(0.2)
    assert rover.mode == "RTL"
    rover.gcs = True
    rover.run(2.0)
    assert "GCS Failsafe Cleared" in rover.texts
    assert rover.mode == "RTL"


@pytest.mark.parametrize(("enabled", "mode"), [(0, "GUIDED"), (1, "HOLD")])
def test_a_lost_remote_control_is_acted_on_if_it_is_enabled(rover, enabled, mode):
    rover.set_param("FS_THR_ENABLE", enabled)
    rover.vehicle.set_fault("rc_loss", 1)
    rover.run(3.0)
    assert rover.mode == mode
    assert ("Throttle Failsafe" in rover.texts) is bool(enabled)


@pytest.mark.parametrize(("action", "mode"), [(0, "GUIDED"), (1, "HOLD")])
def test_a_lost_position_is_told_and_acted_on_by_its_parameter(rover, action, mode):
    rover.set_param("FS_EKF_ACTION", action)
    rover.vehicle.set_fault("gps_loss", 1)
    rover.until(lambda: "EKF failsafe" in rover.texts, limit=20.0)
    assert rover.mode == mode


@pytest.mark.parametrize(("action", "mode"), [(0, "GUIDED"), (1, "RTL"), (2, "HOLD")])
def test_a_low_battery_is_acted_on_by_its_parameter(rover, action, mode):
    rover.set_param("BATT_FS_LOW_ACT", action)
    rover.set_param("BATT_LOW_TIMER", 1)
    rover.vehicle.set_fault("low_battery", 5)
    rover.run(2.0)
    assert rover.mode == mode
    assert any(text.startswith("Battery 1 is low") for text in rover.texts)


def test_without_a_position_it_holds_where_it_should_return(rover):
    rover.set_param("FS_EKF_ACTION", 0)
    rover.set_param("BATT_FS_LOW_ACT", 1)
    rover.set_param("BATT_LOW_TIMER", 1)
    rover.vehicle.set_fault("gps_loss", 1)
    rover.until(lambda: "EKF failsafe" in rover.texts, limit=20.0)
    rover.vehicle.set_fault("low_battery", 5)
    rover.run(2.0)
    assert rover.mode == "HOLD"
