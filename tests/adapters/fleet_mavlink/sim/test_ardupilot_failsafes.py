"""Fail-safes of ArduCopter 4.6.3: what its parameters make it do, and when."""

import pytest
from pymavlink.dialects.v20 import all as mav

ACCEPTED, FAILED = 0, 4


@pytest.fixture
def flying(ap):
    ap.climb()
    return ap


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


@pytest.mark.parametrize(("value", "mode"), [(0, "GUIDED"), (1, "RTL"), (5, "LAND")])
def test_a_lost_station_is_acted_on_by_its_parameter(flying, value, mode):
    flying.set_param("FS_GCS_ENABLE", value)
    flying.gcs = False
    flying.run(7.0)
    assert flying.mode == mode


def test_a_lost_station_is_acted_on_after_its_time_and_not_before(flying):
    flying.set_param("FS_GCS_ENABLE", 1)
    flying.set_param("FS_GCS_TIMEOUT", 8)
    flying.lose_station()
    assert flying.until(lambda: flying.mode == "RTL", 20.0) == pytest.approx(8.0, abs=0.3)


def test_a_station_that_was_never_heard_is_not_lost(bench):
    ap = bench("ardupilot")
    ap.gcs = False
    ap.set_param("FS_GCS_ENABLE", 1)
    ap.climb()
    ap.run(10.0)
    assert ap.mode == "GUIDED"


@pytest.mark.parametrize(("value", "mode"), [(0, "GUIDED"), (1, "LAND"), (2, "RTL")])
def test_a_low_battery_is_acted_on_once_by_its_parameter(flying, value, mode):
    flying.set_param("BATT_FS_LOW_ACT", value)
    flying.set_param("BATT_LOW_TIMER", 1)
    flying.vehicle.set_fault("low_battery", 5)
    flying.run(2.0)
    assert flying.mode == mode
    flying.set_mode("GUIDED")
    flying.run(5.0)
    assert flying.mode == "GUIDED"
    assert len([text for text in flying.texts if text.startswith("Battery 1 is low")]) == 1


def test_a_battery_that_is_low_for_a_moment_is_not_low(flying):
    flying.set_param("BATT_FS_LOW_ACT", 2)
    flying.set_param("BATT_LOW_TIMER", 5)
    flying.vehicle.set_fault("low_battery", 5)
    flying.run(4.0)
    flying.pilot.battery.percent = 90.0
    flying.run(4.0)
    flying.vehicle.set_fault("low_battery", 5)
    flying.run(4.0)
    assert flying.mode == "GUIDED"


@pytest.mark.parametrize(("value", "mode"), [(0, "GUIDED"), (1, "RTL")])
def test_a_broken_fence_is_told_and_acted_on_by_its_parameter(flying, value, mode):
    for name, setting in (
        ("FENCE_TYPE", 2),
        ("FENCE_RADIUS", 30),
        ("FENCE_ENABLE", 1),
        ("FENCE_ACTION", value),
    ):
        flying.set_param(name, setting)
    flying.stream(9.0, 5.0, frame=1)
    assert flying.texts.count("Fence Breached") == 1
    assert flying.mode == mode


def test_a_lost_position_is_no_matter_in_a_mode_that_needs_none(ap):
    ap.climb(40.0)
    ap.set_mode("ALT_HOLD")
    ap.vehicle.set_fault("gps_loss", 1)
    ap.until(lambda: not ap.pilot.has_position, 12.0)
    ap.run(0.2)
    assert ap.pilot.flying
    assert (ap.mode, ap.pilot.failsafe) == ("ALT_HOLD", "")


def test_the_end_of_a_flight_ends_its_fail_safe(flying):
    flying.set_param("FS_GCS_ENABLE", 5)
    flying.gcs = False
    flying.until(lambda: not flying.pilot.armed, 60.0)
    flying.run(0.2)
    assert flying.pilot.failsafe == ""
