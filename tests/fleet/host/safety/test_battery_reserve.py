"""What must be left in the battery."""

import pytest

from fleet.host.safety.battery_reserve import CHARGED, BatteryReserve

RESERVE = BatteryReserve(keep=20.0, low=15.0, endurance=600.0)


def test_a_way_that_leaves_the_reserve_may_be_begun():
    assert RESERVE.trouble(50.0, metres=600.0, speed=5.0) == ""  # 120 s of 600: 20 %


def test_a_way_that_eats_into_the_reserve_is_refused_with_the_figures():
    why = RESERVE.trouble(35.0, metres=600.0, speed=5.0)
    assert why == "the battery is at 35 %, the way there and home takes 20 % and 20 % must be left"


def test_nothing_is_begun_with_a_battery_that_nobody_knows():
    assert "unknown" in RESERVE.trouble(None)


def test_without_an_endurance_only_the_charge_counts():
    assert BatteryReserve(20.0, 15.0).trouble(21.0, metres=1e6, speed=1.0) == ""
    assert BatteryReserve(20.0, 15.0).trouble(19.0) != ""


@pytest.mark.parametrize(
    ("keep", "low", "percent", "starts"),
    [
        (15, 20, 20.1, True),
        (15, 20, 20.0, False),
        (15, 20, 16, False),
        (25, 20, 24, False),
        (25, 20, 25, True),
    ],
)
def test_a_flight_begins_only_above_what_is_low_and_with_the_reserve(keep, low, percent, starts):
    why = BatteryReserve(keep, low).start_trouble(percent)
    assert (why == "") is starts
    assert f"{max(keep, low)} %" in why or starts


def test_a_flight_does_not_begin_with_a_battery_that_nobody_knows():
    assert "unknown" in BatteryReserve(15.0, 20.0).start_trouble(None)


def test_low_is_said_at_the_figure_and_below():
    assert RESERVE.is_low(15.0)
    assert not RESERVE.is_low(15.1)
    assert not RESERVE.is_low(None)


def test_a_battery_that_wavers_about_low_has_not_been_charged():
    assert not RESERVE.is_charged(15.1)
    assert not RESERVE.is_charged(15.0 + CHARGED - 0.1)
    assert RESERVE.is_charged(15.0 + CHARGED)
