"""Fail-safes of ArduPlane 4.6.3: RTL, FS_LONG_TIMEOUT after a loss."""

import math

import pytest

ACCEPTED = 0


@pytest.fixture
def flying(flying_plane):
    return flying_plane


def test_a_plane_without_its_station_flies_home_and_circles_there(flying):
    flying.set_param("FS_GCS_ENABL", 1)
    flying.set_param("FS_LONG_ACTN", 1)
    flying.set_param("SYSID_MYGCS", 255)
    flying.run(2.0)
    flying.gcs = False
    flying.until(lambda: flying.mode == "RTL", 10.0)
    assert "GCS Failsafe On" in flying.texts
    flying.run(90.0)
    assert math.hypot(flying.body.north, flying.body.east) < 130.0
    assert flying.height > 80.0


@pytest.mark.parametrize(("action", "mode"), [(0, "TAKEOFF"), (1, "RTL")])
def test_a_lost_station_is_told_and_acted_on_by_its_parameter(flying, action, mode):
    flying.set_param("FS_GCS_ENABL", 1)
    flying.set_param("FS_LONG_ACTN", action)
    flying.gcs = False
    flying.run(9.0)
    assert flying.mode == mode
    assert flying.texts.count("GCS Failsafe On") == 1


def test_a_lost_station_is_acted_on_after_its_time_and_a_second_loss_again(flying):
    flying.set_param("FS_GCS_ENABL", 1)
    flying.set_param("FS_LONG_TIMEOUT", 3)
    flying.lose_station()
    assert flying.until(lambda: "GCS Failsafe On" in flying.texts, 10.0) == pytest.approx(4.0, abs=0.3)
    flying.gcs = True
    flying.run(2.0)
    flying.gcs = False
    flying.run(6.0)
    assert flying.texts.count("GCS Failsafe On") == 2


def test_it_is_off_unless_it_is_enabled(flying):
    flying.set_param("FS_LONG_ACTN", 1)
    flying.gcs = False
    flying.run(10.0)
    assert (flying.mode, "GCS Failsafe On" in flying.texts) == ("TAKEOFF", False)


@pytest.mark.parametrize(("enabled", "mode"), [(0, "TAKEOFF"), (1, "RTL")])
def test_a_lost_remote_control_is_acted_on_if_it_is_enabled(flying, enabled, mode):
    flying.set_param("THR_FAILSAFE", enabled)
    flying.set_param("FS_LONG_ACTN", 1)
    flying.vehicle.set_fault("rc_loss", 1)
    flying.run(7.0)
    assert flying.mode == mode
    assert ("RC Long Failsafe On" in flying.texts) is bool(enabled)


@pytest.mark.parametrize(("action", "mode"), [(0, "TAKEOFF"), (1, "RTL")])
def test_a_low_battery_is_told_and_acted_on_by_its_parameter(flying, action, mode):
    flying.set_param("BATT_FS_LOW_ACT", action)
    flying.set_param("BATT_LOW_TIMER", 1)
    flying.vehicle.set_fault("low_battery", 5)
    flying.run(2.0)
    assert flying.mode == mode
    assert any(text.startswith("Battery 1 is low") for text in flying.texts)


def test_on_the_ground_nothing_is_lost(plane):
    plane.set_param("FS_GCS_ENABL", 1)
    plane.set_param("FS_LONG_ACTN", 1)
    plane.gcs = False
    plane.run(9.0)
    assert "GCS Failsafe On" not in plane.texts
    assert plane.mode == "GUIDED"
