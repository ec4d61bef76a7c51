"""The battery of a simulated vehicle: what it has left, and for how long."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_mavlink.sim.battery import SimBattery

FULL, EMPTY = 16.8, 13.2


def battery(whole=math.ceil):
    return SimBattery(FULL, EMPTY, whole, capacity_mah=5000.0)


def test_a_full_battery_has_all_of_its_charge_and_its_volts():
    it = battery()
    assert (it.percent, it.volts, it.used_mah) == (100.0, pytest.approx(FULL), 0.0)
    assert it.seconds_left == pytest.approx(5.0 / 0.5 * 3600)


def test_in_the_air_it_lasts_as_long_as_twelve_amperes_leave_it():
    it = battery()
    it.drain(flying=True, dt=60.0)
    assert it.amperes == 12.0
    assert it.used_mah == pytest.approx(200.0)
    assert it.percent == pytest.approx(96.0)
    assert it.seconds_left == pytest.approx((5000.0 - 200.0) / 12_000.0 * 3600)
    it.drain(flying=False, dt=60.0)
    assert it.amperes == 0.5
    assert it.used_mah == pytest.approx(200.0 + 0.5 * 1000 / 60)


def test_an_empty_battery_is_empty_and_no_less():
    it = battery()
    it.drain(flying=True, dt=1e6)
    assert (it.percent, it.volts, it.seconds_left) == (0.0, pytest.approx(EMPTY), 0.0)


@pytest.mark.parametrize(("whole", "told"), [(math.ceil, 97), (math.floor, 96)])
def test_percents_are_rounded_as_the_autopilot_does(whole, told):
    it = battery(whole)
    it.percent = 96.4
    assert it.whole_percent == told


@given(st.floats(EMPTY, FULL))
def test_a_discharged_battery_has_those_volts(volts):
    it = battery()
    it.at_most(volts=volts)
    assert it.volts == pytest.approx(volts)


def test_a_battery_is_not_charged_by_more_volts_nor_drained_below_nothing():
    it = battery()
    it.percent = 50.0
    it.at_most(volts=FULL)
    assert it.percent == 50.0
    it.at_most(volts=1.0)
    assert it.percent == 0.0
