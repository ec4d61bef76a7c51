"""The inputs of a mission: which values they take, and which value stands for them while it is checked."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from fleet.missions.model import InputConfig

TYPES = ("number", "integer", "text", "boolean", "place", "robot")
FITTING = {
    "number": (int, float),
    "integer": (int,),
    "text": (str,),
    "boolean": (bool,),
    "place": (str,),
    "robot": (str,),
}
VALUES = (5, 5.5, "x", "gate", "rex", True, False, None, [], {})


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize("value", VALUES)
def test_an_input_takes_values_of_its_type_alone(kind, value):
    trouble = InputConfig(type=kind).trouble(value)
    fits = type(value) in FITTING[kind]
    assert trouble == ("" if fits else f"must be {kind}, not {value!r}")


@given(value=st.floats() | st.integers(), least=st.integers(-9, 0), most=st.integers(0, 9))
def test_a_number_is_taken_exactly_when_it_is_within_its_bounds(value, least, most):
    trouble = InputConfig(type="number", min=least, max=most).trouble(value)
    assert (trouble == "") == (least <= value <= most)


@pytest.mark.parametrize(
    ("value", "trouble"),
    [
        (3, ""),
        (30, ""),
        (2.9, "must be at least 3"),
        (30.1, "must be at most 30"),
        (math.nan, "must be a finite number"),
        (math.inf, "must be a finite number"),
        (-math.inf, "must be a finite number"),
        (10**400, "must be at most 30"),
    ],
)
def test_a_number_out_of_its_bounds_is_refused_with_the_bound(value, trouble):
    assert InputConfig(type="number", min=3, max=30).trouble(value) == trouble


def test_a_number_without_bounds_is_finite_all_the_same():
    assert InputConfig(type="number").trouble(1e300) == ""
    assert InputConfig(type="number").trouble(math.nan) == "must be a finite number"


@pytest.mark.parametrize(
    ("fields", "refusal"),
    [
        ({"type": "text", "min": 1}, "only a number has bounds"),
        ({"type": "place", "max": 1}, "only a number has bounds"),
        ({"type": "number", "min": 4, "max": 3}, "is more than max"),
        ({"type": "number", "default": 2, "min": 3}, "must be at least 3"),
        ({"type": "integer", "default": 2.5}, "must be integer, not 2.5"),
        ({"type": "boolean", "default": 1}, "must be boolean, not 1"),
        ({"type": "number", "min": 3, "max": 3, "default": 3}, ""),
        ({"type": "integer", "min": 1}, ""),
        ({"type": "boolean", "default": False}, ""),
    ],
)
def test_an_input_that_nothing_could_fit_is_refused(fields, refusal):
    try:
        InputConfig.model_validate(fields, strict=True)
        refused = ""
    except ValidationError as error:
        refused = error.errors()[0]["msg"]
    assert refused == refusal


@pytest.mark.parametrize(
    ("fields", "sample"),
    [
        ({"type": "number", "default": 0}, 0),
        ({"type": "number", "min": 3, "max": 9}, 3),
        ({"type": "number", "max": 9}, 9),
        ({"type": "integer"}, 1),
        ({"type": "boolean"}, False),
        ({"type": "boolean", "default": True}, True),
        ({"type": "place"}, "any"),
        ({"type": "text", "default": ""}, ""),
    ],
)
def test_a_sample_is_a_value_that_the_input_takes(fields, sample):
    config = InputConfig(**fields)
    assert (config.sample, config.trouble(config.sample)) == (sample, "")
