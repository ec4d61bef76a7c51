"""How far it is still to go, and how long at the pace of the last seconds."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.host.requests.remaining_distance import SHORTEST, SLOWEST, WINDOW, RemainingDistance


def estimate(*metres, every=0.5):
    left = RemainingDistance()
    for number, each in enumerate(metres):
        left.update(each, number * every)
    return left


def test_the_seconds_follow_from_the_pace_of_the_last_seconds():
    left = estimate(10.0, 9.5, 9.0, 8.5)
    assert (left.metres, left.seconds) == (8.5, pytest.approx(8.5))


def test_before_it_moves_for_a_second_only_the_metres_are_known():
    left = estimate(10.0, 9.5)
    assert (left.metres, left.seconds) == (9.5, None)
    assert estimate(10.0, 10.0, 10.0, 10.0).seconds is None


def test_a_robot_that_is_held_up_has_no_pace_any_more():
    left = estimate(10.0, 9.0, 8.0)
    assert left.seconds is not None
    for number in range(20):
        left.update(8.0, 2.0 + number * 0.5)
    assert (left.metres, left.seconds) == (8.0, None)


def test_a_rest_is_no_slow_way():
    left = estimate(10.0, 9.0, 8.0)
    left.rest()
    assert (left.metres, left.seconds) == (8.0, None)
    left.update(8.0, 100.0)
    left.update(7.0, 101.0)
    assert left.seconds == pytest.approx(7.0)


@pytest.mark.parametrize("unknown", [None, math.inf, math.nan])
def test_while_the_place_is_unknown_nothing_is_reported(unknown):
    left = estimate(10.0, 9.0, 8.0, unknown)
    assert (left.metres, left.seconds) == (None, None)


@given(st.lists(st.tuples(st.floats(0, 1e4), st.floats(0.01, 3)), max_size=40))
def test_whatever_is_reported_the_seconds_are_finite_and_no_pace_is_older_than_the_window(steps):
    left, now = RemainingDistance(), 0.0
    for metres, elapsed in steps:
        now += elapsed
        left.update(metres, now)
        assert left.seconds is None or 0 <= left.seconds <= metres / SLOWEST
        assert all(now - when <= WINDOW for when, _ in left._seen)
    assert SHORTEST < WINDOW
