"""What becomes of a value in JSON, and what cannot be sent."""

import json
import math

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.wire.encoding import encode_finite

NAN, INF = math.nan, math.inf
VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)


class Point(msgspec.Struct):
    x: float
    name: str | None = None


def refused(value):
    with pytest.raises(WireError) as refusal:
        encode_finite(value)
    return refusal.value


@settings(max_examples=50)
@given(VALUES)
def test_every_finite_value_is_read_back_as_it_was(value):
    assert json.loads(encode_finite(value)) == value


@settings(max_examples=30)
@given(VALUES, st.sampled_from([NAN, INF, -INF]))
def test_no_number_that_is_not_finite_is_ever_sent(value, number):
    assert refused([value, {"deep": (1.0, number)}]).where == "1.deep.1"


@pytest.mark.parametrize(
    ("value", "where"),
    [
        (NAN, ""),
        ({"a": NAN}, "a"),
        ({"a": {"b": [0.0, -INF]}}, "a.b.1"),
        ((1.0, INF), "1"),
        ({"a": [{"b": NAN}, NAN]}, "a.0.b"),
        (Point(NAN), "x"),
        ({"p": [Point(1.0), Point(INF)]}, "p.1.x"),
    ],
)
def test_the_first_number_that_is_not_finite_is_named(value, where):
    error = refused(value)
    assert error.where == where
    assert str(error).endswith("not a finite number")


@pytest.mark.parametrize("value", [None, {"a": None}, Point(1.0), {"null": 1.0}, "null", [None, 0.0]])
def test_a_null_that_is_meant_is_sent(value):
    assert encode_finite(value) == msgspec.json.encode(value)


def too_deep():
    value = []
    for _ in range(100_000):
        value = [value]
    return value


@pytest.mark.parametrize(
    "value",
    [object(), {1, object()}, "\ud800", {(1, 2): 3}, 1j, too_deep()],
    ids=lambda value: type(value).__name__,
)
def test_what_json_cannot_hold_is_refused(value):
    assert str(refused({"a": value})).startswith("cannot be sent as JSON: ")
