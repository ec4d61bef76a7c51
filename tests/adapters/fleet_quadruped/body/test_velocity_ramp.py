"""No request makes the body go, or change its velocity, faster than its limits."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.velocity_ramp import limited, ramped, within
from fleet_quadruped.robot.parts import Pace

PACE = Pace(speed=0.8, strafe=0.3, turn=1.0, acceleration=0.8, turn_acceleration=2.5)
velocities = st.builds(Twist, st.floats(-9, 9), st.floats(-9, 9), st.floats(-9, 9))
slow = st.builds(Twist, st.floats(-0.8, 0.8), st.floats(-0.3, 0.3), st.floats(-1, 1))
shares = st.floats(0.05, 1.0)


def part_of(velocity):
    """Return which part of the limits a velocity is."""
    return math.hypot(velocity.x / PACE.speed, velocity.y / PACE.strafe, velocity.turn / PACE.turn)


@given(velocities, shares)
def test_a_velocity_is_within_the_limits_in_the_direction_of_the_request(wanted, share):
    got = limited(wanted, PACE, share)
    assert part_of(got) <= share * (1 + 1e-9)
    for one, other in [(got.x, wanted.x), (got.y, wanted.y), (got.turn, wanted.turn)]:
        assert one * other >= 0.0
        assert abs(one) <= abs(other)
    for (one, two), (was, were) in [
        ((got.x, got.y), (wanted.x, wanted.y)),
        ((got.x, got.turn), (wanted.x, wanted.turn)),
    ]:
        assert one * were == pytest.approx(two * was, abs=1e-9)


@given(velocities)
def test_what_is_within_the_limits_is_not_changed(wanted):
    if part_of(wanted) < 1.0:
        assert limited(wanted, PACE) == wanted
    else:
        assert part_of(limited(wanted, PACE)) == pytest.approx(1.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("axis", ["x", "y", "turn"])
def test_what_is_no_number_is_a_standstill(bad, axis):
    assert limited(Twist(**{axis: bad}), PACE) == Twist()
    assert limited(Twist(0.1, 0.1, 0.1), PACE) != Twist()


@given(slow, slow, st.floats(0.001, 0.1))
def test_a_velocity_changes_no_faster_than_the_limits_and_never_beyond_its_goal(now, goal, dt):
    after = ramped(now, goal, PACE, dt)
    for was, is_, wanted, most in [
        (now.x, after.x, goal.x, PACE.acceleration * dt),
        (now.y, after.y, goal.y, PACE.acceleration * dt),
        (now.turn, after.turn, goal.turn, PACE.turn_acceleration * dt),
    ]:
        assert abs(is_ - was) <= most + 1e-12
        assert min(was, wanted) - 1e-12 <= is_ <= max(was, wanted) + 1e-12


@given(slow, slow)
def test_every_goal_is_reached_in_the_time_that_the_limits_allow(now, goal):
    time = max(
        abs(goal.x - now.x) / PACE.acceleration,
        abs(goal.y - now.y) / PACE.acceleration,
        abs(goal.turn - now.turn) / PACE.turn_acceleration,
    )
    for _ in range(math.ceil(time / 0.02) + 1):
        now = ramped(now, goal, PACE, 0.02)
    assert tuple(now) == pytest.approx(tuple(goal), abs=1e-9)


@pytest.mark.parametrize(("value", "clamped"), [(3.0, 2.0), (-3.0, -2.0), (1.5, 1.5), (-2.0, -2.0)])
def test_a_value_is_clamped_to_both_sides(value, clamped):
    assert within(value, 2.0) == clamped
