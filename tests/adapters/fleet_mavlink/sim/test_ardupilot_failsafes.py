"""Fail-safes of ArduCopter 4.6.3: what its parameters make it do, and when."""

import pytest
from pymavlink.dialects.v20 import all as mav

ACCEPTED, FAILED = 0, 4


@pytest.fixture
def ap(bench):
    return bench("ardupilot")


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
