"""Numbers of messages with bounds."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.wire.measures import not_negative, positive, within

FINITE = st.floats(allow_nan=False, allow_infinity=False)
NO_NUMBERS = [None, "1", True, [], {}, float("nan"), float("inf"), -float("inf"), 10**400]


def refused(read, *arguments):
    with pytest.raises(WireError) as refusal:
        read(*arguments)
    return str(refusal.value)


@pytest.mark.parametrize("read", [positive, not_negative])
def test_an_optional_number_that_is_missing_is_none(read):
    assert read({"other": -1}, "speed") is None


@pytest.mark.parametrize("value", [1, 2.5, 5e-324, 1.7e308])
def test_a_number_within_its_bound_is_returned_as_it_is(value):
    assert (positive({"a": value}, "a"), not_negative({"a": value}, "a")) == (value, value)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (0, "limits.speed: more than 0 is needed, not 0.0"),
        (-0.0, "limits.speed: more than 0 is needed, not -0.0"),
        (-2, "limits.speed: more than 0 is needed, not -2.0"),
    ],
)
def test_zero_is_not_more_than_zero(value, message):
    assert refused(positive, {"speed": value}, "speed", "limits") == message


def test_zero_is_not_negative():
    assert (not_negative({"a": 0}, "a"), not_negative({"a": -0.0}, "a")) == (0.0, 0.0)
    assert refused(not_negative, {"a": -5e-324}, "a") == "a: 0 or more is needed, not -5e-324"


@pytest.mark.parametrize("value", [2.5, -2.5, 0, 1])
def test_a_number_is_within_its_bounds_on_both_sides(value):
    assert within({"a": value}, "a", "", 2.5) == value


@pytest.mark.parametrize("value", [2.5000001, -2.5000001, 1e300])
def test_a_number_outside_its_bounds_is_refused_with_them(value):
    assert (
        refused(within, {"a": value}, "a", "0.pose", 2.5) == f"0.pose.a: -2.5 to 2.5 is needed, not {value}"
    )


def test_a_bounded_number_is_required():
    assert refused(within, {}, "a", "pose", 1.0) == "pose.a: is missing"


@pytest.mark.parametrize("value", NO_NUMBERS)
@pytest.mark.parametrize(
    "read", [positive, not_negative, lambda members, name, where: within(members, name, where, 1e9)]
)
def test_what_is_no_finite_number_is_refused_with_its_place(read, value):
    assert refused(read, {"a": value}, "a", "here").startswith("here.a: ")


@given(FINITE, st.floats(0, 1e308))
def test_a_number_is_returned_or_refused_and_never_clamped(value, most):
    try:
        assert within({"a": value}, "a", "", most) == value
    except WireError:
        assert not -most <= value <= most
    else:
        assert -most <= value <= most
