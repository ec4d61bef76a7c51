"""Short forms are spelt out and inputs filled in; whatever else is said, the models have to refuse."""

import copy

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.missions.short_forms import normalised

keys = st.sampled_from(["roles", "steps", "do", "undo", "repeat", "count", "input", "eye", "command"])
anything = st.recursive(
    st.none() | st.booleans() | st.integers() | keys,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3),
    max_leaves=6,
)


def steps(*given_steps):
    return {"steps": list(given_steps)}


@pytest.mark.parametrize(
    ("role", "long"),
    [
        ({"count": 3}, {"count": {"min": 3, "max": 3}}),
        ({"count": 0, "kind": "ugv"}, {"count": {"min": 0, "max": 0}, "kind": "ugv"}),
        ({"count": {"min": 1}}, {"count": {"min": 1}}),
        ({"count": True}, {"count": True}),
        ({"count": "3"}, {"count": "3"}),
        ({}, {}),
        (None, None),
    ],
)
def test_a_count_is_both_bounds(role, long):
    assert normalised({"roles": {"eye": role}}, {}) == {"roles": {"eye": long}}


def test_a_word_is_a_command_also_to_undo_and_in_repeated_steps():
    short = {"do": {"eye": "takeoff", "feet": {"goto": "gate"}}, "undo": {"eye": "land"}}
    long = {
        "do": {"eye": {"command": "takeoff"}, "feet": {"goto": "gate"}},
        "undo": {"eye": {"command": "land"}},
    }
    assert normalised(steps(short), {}) == steps(long)
    nested = {"repeat": {"times": 2, "steps": [{"repeat": {"times": 3, "steps": [short]}}]}}
    assert normalised(steps(nested), {}) == steps(
        {"repeat": {"times": 2, "steps": [{"repeat": {"times": 3, "steps": [long]}}]}}
    )


def test_inputs_are_filled_in_wherever_they_stand_and_before_short_forms():
    data = {
        "roles": {"eye": {"count": {"input": "many"}}},
        "steps": [{"do": {"eye": {"input": "what"}, "feet": {"goto": [{"input": "x"}, 2]}}}],
    }
    assert normalised(data, {"many": 2, "what": "land", "x": 7}) == {
        "roles": {"eye": {"count": {"min": 2, "max": 2}}},
        "steps": [{"do": {"eye": {"command": "land"}, "feet": {"goto": [7, 2]}}}],
    }


@pytest.mark.parametrize(
    "value", [{"input": "x", "unit": "m"}, {"input": 7}, {"input": ["x"]}, {"input": "y"}]
)
def test_only_a_whole_value_with_a_known_name_is_an_input(value):
    assert normalised({"a": value}, {"x": 1, "7": 2}) == {"a": value}


@pytest.mark.parametrize("value", [None, False, 0, "", [], {}])
def test_a_value_that_is_nothing_is_filled_in_too(value):
    assert normalised({"a": {"input": "x"}}, {"x": value}) == {"a": value}


@settings(max_examples=50)
@given(data=anything, values=st.dictionaries(st.text(max_size=3), st.integers(), max_size=2))
def test_nothing_makes_it_fail_and_nothing_that_it_is_given_changes(data, values):
    before = copy.deepcopy(data)
    long = normalised(data, values)
    assert data == before
    assert normalised(long, {}) == normalised(normalised(long, {}), {}), "what is long stays so"
