"""A machine that does not do what it is told, or moves untold, is noticed within a second or two."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.selfwalk.velocity_check import VelocityCheck

DT = 0.01
STILL = Twist()
FORWARD = Twist(0.5)


def check(wanted, reported, seconds, checker=None):
    """Compare for some time; return the check."""
    checker = checker or VelocityCheck()
    for _ in range(round(seconds / DT)):
        checker.check_cycle(DT, wanted, reported)
    return checker


@pytest.mark.parametrize(
    ("wanted", "reported"),
    [
        (FORWARD, STILL),
        (FORWARD, Twist(0.12)),
        (FORWARD, Twist(-0.5)),
        (Twist(0.0, 0.3), Twist(0.3, 0.0)),
        (Twist(turn=0.5), STILL),
        (Twist(turn=0.5), Twist(turn=-0.5)),
        (Twist(turn=-0.5), Twist(turn=0.5)),
        (Twist(0.5, turn=0.5), Twist(0.5)),
    ],
)
def test_one_that_does_not_follow_is_told_after_a_second(wanted, reported):
    checker = check(wanted, reported, 0.98)
    assert checker.why == ""
    check(wanted, reported, 0.05, checker)
    assert checker.why.startswith(f"requested {math.hypot(wanted.x, wanted.y):.2f} m/s and {wanted.turn:.2f}")
    assert checker.why.endswith("it is blocked, or does not follow")
    assert checker.runs == ""


@pytest.mark.parametrize(
    ("wanted", "reported"),
    [
        (FORWARD, FORWARD),
        (FORWARD, Twist(0.13)),
        (FORWARD, Twist(2.0)),
        (Twist(turn=-0.5), Twist(turn=-0.2)),
        (Twist(0.09), STILL),
        (Twist(turn=0.19), STILL),
        (STILL, Twist(0.1, 0.1)),
        (STILL, Twist(turn=-0.29)),
    ],
)
def test_one_that_follows_or_is_told_to_do_too_little_to_tell_is_left_alone(wanted, reported):
    checker = check(wanted, reported, 60.0)
    assert (checker.why, checker.runs) == ("", "")


@pytest.mark.parametrize("reported", [Twist(0.16), Twist(0.0, -0.2), Twist(0.12, 0.12), Twist(turn=-0.31)])
def test_one_that_moves_though_it_should_stand_is_told_after_a_second_and_a_half(reported):
    checker = check(STILL, reported, 1.48)
    assert checker.runs == ""
    check(STILL, reported, 0.05, checker)
    assert checker.runs.startswith("requested to stand still, reports ")
    assert checker.why == ""


def test_one_cycle_of_obedience_begins_the_time_anew():
    checker = check(FORWARD, STILL, 0.99)
    check(FORWARD, FORWARD, DT, checker)
    assert check(FORWARD, STILL, 0.99, checker).why == ""
    checker = check(STILL, FORWARD, 1.49)
    check(STILL, STILL, DT, checker)
    assert check(STILL, FORWARD, 1.49, checker).runs == ""


def test_what_was_wrong_is_not_told_once_it_is_right():
    assert check(FORWARD, FORWARD, DT, check(FORWARD, STILL, 2.0)).why == ""
    assert check(STILL, STILL, DT, check(STILL, FORWARD, 2.0)).runs == ""


speeds = st.builds(Twist, st.floats(-1, 1), st.floats(-1, 1), st.floats(-2, 2))


@given(speeds)
def test_whatever_it_is_told_one_that_does_exactly_that_is_never_blamed(wanted):
    checker = check(wanted, wanted, 3.0)
    assert (checker.why, checker.runs) == ("", "")
