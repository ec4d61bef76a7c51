"""Tests of the checker: valid histories pass, and each broken guarantee is found."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.tools.promises import Event, Rules, What, broken

RULES = Rules(max_age=0.5)
LIFE = (What.RECEIVED, What.ADMITTED, What.EXECUTED, What.REPLIED)


def life(request, *whats, at=0.0, **fields):
    return [Event(at + n / 100, what, "rex", request, **fields) for n, what in enumerate(whats)]


@given(st.lists(st.sampled_from([LIFE, (What.RECEIVED, What.REPLIED)])), st.randoms())
def test_good_lives_in_any_mixture_break_nothing(lives, random):
    events = [event for n, whats in enumerate(lives) for event in life(str(n), *whats, at=random.random())]
    random.shuffle(events)
    assert broken(events, RULES) == []


@pytest.mark.parametrize(
    ("whats", "line"),
    [
        ((What.RECEIVED, What.ADMITTED, What.EXECUTED), "received 1 times, replied to 0 times"),
        ((*LIFE, What.REPLIED), "received 1 times, replied to 2 times"),
        ((What.RECEIVED, What.EXECUTED, What.ADMITTED, What.REPLIED), "executed before it was admitted"),
        ((What.RECEIVED, What.ADMITTED, What.EXECUTED, What.EXECUTED, What.REPLIED), "executed twice"),
    ],
)
def test_a_broken_promise_is_found(whats, line):
    assert broken(life("a1", *whats), RULES) == [f"rex a1: {line}"]


def test_what_was_refused_must_not_be_executed_later():
    refused = Event(0.5, What.REPLIED, "rex", "a1", ok=False)
    events = [*life("a1", What.RECEIVED, What.ADMITTED), refused, *life("a1", What.EXECUTED, at=1.0)]
    assert broken(events, RULES) == ["rex a1: executed after it was refused"]


def test_repeats_are_answered_alike():
    events = [*life("a1", *LIFE, What.RECEIVED), Event(1.0, What.REPLIED, "rex", "a1", ok=False)]
    assert broken(events, RULES) == ["rex a1: replied to in two ways"]


def test_motion_must_not_be_old():
    events = life("a1", *LIFE, at=1.0, stamp=0.4, moves=True)
    assert broken(events, RULES) == ["rex a1: stale: it moves the robot 0.620 s after it was asked"]
    assert broken(life("a1", *LIFE, at=1.0, stamp=0.6, moves=True), RULES) == []


@pytest.mark.parametrize("released", [True, False])
def test_nothing_moves_between_a_stop_and_its_release(released):
    events = [Event(1.0, What.STOPPED, "rex"), Event(1.0, What.STOPPED, "max")]
    events += [Event(1.5, What.RELEASED, "rex")] if released else []
    events += life("a1", *LIFE, at=2.0, moves=True)
    assert broken(events, RULES) == ([] if released else ["rex: a1 moves it although it is stopped"])
