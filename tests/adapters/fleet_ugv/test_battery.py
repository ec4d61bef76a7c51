import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_ugv.battery import TEN_LITHIUM, THREE_LITHIUM, checked_curve, percent, voltage


@given(st.floats(0, 100), st.floats(0, 100), st.sampled_from([THREE_LITHIUM, TEN_LITHIUM]))
def test_more_volts_are_never_less_percent(one, other, curve):
    low, high = sorted((percent(one, curve), percent(other, curve)))
    assert 0 <= low <= high <= 100
    assert (percent(min(one, other), curve), percent(max(one, other), curve)) == (low, high)


@given(st.floats(0, 100), st.sampled_from([THREE_LITHIUM, TEN_LITHIUM]))
def test_a_charge_has_the_volts_that_mean_it(charge, curve):
    assert percent(voltage(charge, curve), curve) == pytest.approx(charge, abs=1e-6)


@pytest.mark.parametrize(
    ("volts", "expected"), [(8.0, 0), (9.0, 0), (11.1, 40), (11.25, 50), (12.6, 100), (15, 100)]
)
def test_points_of_the_curve_are_met_and_between_them_it_is_straight(volts, expected):
    assert percent(volts, THREE_LITHIUM) == pytest.approx(expected)


@pytest.mark.parametrize(
    "points", [[], [(9, 0)], [(9, 0), (9, 10)], [(9, 10), (10, 5)], [(9, -1), (10, 5)], [(9, 0), (10, 101)]]
)
def test_a_curve_that_makes_no_sense_is_refused(points):
    with pytest.raises(ValueError, match="curve"):
        checked_curve(points)
