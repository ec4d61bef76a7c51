"""Fail-safes of PX4 1.16.1: it holds first, and acts then."""

import math

import pytest

ACCEPTED, REJECTED = 0, 1


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


@pytest.mark.parametrize(("value", "mode"), [(0, None), (1, "LOITER"), (2, "RTL"), (3, "LAND")])
def test_a_lost_station_is_acted_on_by_its_parameter(flying, value, mode):
    flying.set_param("NAV_DLL_ACT", value)
    flying.set_param("COM_DL_LOSS_T", 5)
    flying.gcs = False
    flying.run(13.5)
    assert (flying.pilot.failsafe == "gcs") is (mode is not None)
    assert flying.mode == (mode or "LOITER")


def test_a_lost_station_is_noticed_two_seconds_after_its_time(flying):
    flying.set_param("NAV_DLL_ACT", 2)
    flying.set_param("COM_DL_LOSS_T", 5)
    flying.run(0.98 - flying.now % 1.0)
    flying.gcs = False
    assert 6.0 < flying.until(lambda: flying.pilot.failsafe == "gcs") < 8.5


def test_a_station_that_was_never_heard_is_not_lost(bench):
    px4 = bench("px4")
    px4.gcs = False
    px4.climb()
    px4.set_param("NAV_DLL_ACT", 2)
    px4.set_param("COM_DL_LOSS_T", 5)
    px4.run(9.0)
    assert px4.pilot.failsafe == ""


@pytest.mark.parametrize(
    ("value", "mode"), [(0, "POSCTL"), (3, "RTL"), (4, "LAND"), (5, "LOITER"), (1, "LOITER")]
)
def test_setpoints_that_stop_are_acted_on_by_their_parameter(offboard, value, mode):
    offboard.set_param("COM_OBL_RC_ACT", value)
    offboard.run(2.0)
    assert (offboard.mode, offboard.pilot.failsafe) == (mode, "offboard")


def test_a_battery_warns_only_if_it_is_told_to_do_no_more(flying):
    flying.set_param("COM_LOW_BAT_ACT", 0)
    flying.vehicle.set_fault("low_battery", 3)
    flying.run(8.0)
    assert flying.mode == "LOITER"
    assert flying.pilot.failsafe == ""
    assert [text.strip() for text in flying.texts].count("Low battery level, return advised") == 1


def test_a_position_that_comes_back_brings_the_chosen_mode_back(flying):
    flying.vehicle.set_fault("gps_loss", 1)
    flying.until(lambda: flying.pilot.failsafe == "position", 20.0)
    assert flying.mode == "LAND"
    flying.vehicle.set_fault("gps_loss", None)
    flying.until(lambda: flying.mode == "LOITER", 10.0)
    assert flying.pilot.failsafe == ""


@pytest.mark.parametrize(("value", "mode"), [(1, "LOITER"), (2, "LOITER"), (3, "RTL")])
def test_a_broken_fence_is_told_and_acted_on_by_its_parameter(flying, value, mode):
    flying.set_param("GF_ACTION", value)
    flying.set_param("GF_MAX_HOR_DIST", 20)
    flying.requests(192, 5.0, 1, 0, math.nan, 47.3985, 8.545594, 498)
    flying.until(lambda: any("Geofence breached" in text for text in flying.texts), 30.0)
    flying.run(0.1)
    assert flying.mode == mode
    assert flying.pilot.failsafe == ("" if value == 1 else "fence")


def test_it_does_not_leave_a_landing_for_a_lost_station(flying):
    flying.set_param("NAV_DLL_ACT", 2)
    flying.set_param("COM_DL_LOSS_T", 5)
    flying.requests(21)
    flying.gcs = False
    flying.run(9.0)
    assert flying.mode == "LAND"


def test_a_new_command_ends_a_fail_safe_before_its_second_step(flying):
    flying.set_param("NAV_DLL_ACT", 2)
    flying.set_param("COM_DL_LOSS_T", 5)
    flying.gcs = False
    flying.until(lambda: flying.pilot.failsafe == "gcs", 20.0)
    flying.gcs = True
    flying.run(1.0)
    assert flying.set_mode("LOITER") == [ACCEPTED, ACCEPTED]
    flying.run(8.0)
    assert flying.mode == "LOITER"
