import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.host.follow.motion_laws import (
    MotionLimits,
    approach,
    bearing,
    holonomic_velocity,
    pursue,
    ramp,
    turning,
)
from fleet.model.geometry import ZERO_VELOCITY, Pose, Vector3, Velocity, quaternion_from_yaw

PACE = MotionLimits(speed=0.5, yaw_rate=1.0)
ANGLES, PLACES = st.floats(-math.pi, math.pi), st.floats(-5, 5)


def pose(x=0.0, y=0.0, yaw=0.0):
    return Pose(Vector3(x, y), quaternion_from_yaw(yaw))


@given(st.builds(pose, PLACES, PLACES, ANGLES), st.tuples(PLACES, PLACES), st.floats(0, 10), st.booleans())
def test_no_law_asks_for_more_than_the_pace(here, target, distance, backwards):
    for velocity in (
        pursue(here, target, distance, PACE, backwards=backwards),
        holonomic_velocity(here, target, distance, 0.0, PACE),
    ):
        assert velocity.linear.horizontal() <= 0.5 + 1e-9
        assert abs(velocity.yaw_rate) <= 1.0 + 1e-9


def test_it_turns_to_the_side_of_its_aim_and_backs_with_the_same_sense():
    assert pursue(pose(), (1.0, 0.5), 2.0, PACE, backwards=False).yaw_rate > 0
    back = pursue(pose(), (-1.0, 0.5), 2.0, PACE, backwards=True)
    assert back.linear.x < 0
    assert back.yaw_rate < 0


@given(st.floats(0, 20))
def test_it_can_always_stop_before_its_end(distance):
    speed = approach(distance, PACE)
    assert speed <= max(0.05, math.sqrt(2 * 0.25 * distance)) + 1e-9


def test_a_turn_takes_the_short_side_and_is_never_lost_in_stiction():
    assert turning(0.03, PACE) == 0.2
    assert turning(-3.0, PACE) == -1.0


def test_a_bearing_is_left_positive_and_wraps():
    assert bearing(pose(yaw=math.pi), (-1.0, -0.1)) > 0
    assert bearing(pose(), (-1.0, 0.0), backwards=True) == pytest.approx(0.0)


SOME = st.builds(Velocity, st.builds(Vector3, st.floats(-1, 1), st.floats(-1, 1)), st.floats(-2, 2))


@given(SOME, SOME, st.floats(0, 0.5))
def test_a_ramp_keeps_to_the_acceleration_and_gets_there(now, wanted, elapsed):
    after = ramp(now, wanted, PACE, elapsed)
    assert (after.linear - now.linear).norm() <= 0.5 * elapsed + 1e-9
    assert abs(after.yaw_rate - now.yaw_rate) <= 3.0 * elapsed + 1e-9
    assert ramp(now, ZERO_VELOCITY, PACE, 100.0).is_zero
