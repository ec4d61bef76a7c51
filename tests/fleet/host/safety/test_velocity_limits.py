"""Velocities are kept within the limits of their robot."""

import math

from hypothesis import given
from hypothesis import strategies as st

from fleet.host.safety.velocity_limits import clamp
from fleet.model.geometry import Vector3, Velocity
from fleet.robot_config import Limits

SPEEDS = st.floats(-100, 100)
VELOCITIES = st.builds(Velocity, st.builds(Vector3, SPEEDS, SPEEDS, SPEEDS), SPEEDS)
SOME_LIMITS = st.builds(
    Limits,
    speed=st.none() | st.floats(0.01, 50),
    vertical_speed=st.none() | st.floats(0.01, 50),
    yaw_rate=st.none() | st.floats(0.01, 50),
)


@given(VELOCITIES, SOME_LIMITS)
def test_a_clamped_velocity_is_within_the_limits_and_keeps_its_direction(velocity, limits):
    clamped = clamp(velocity, limits)
    assert clamped.gait == velocity.gait
    assert clamped.linear.horizontal() <= (limits.speed or math.inf) * (1 + 1e-9)
    assert abs(clamped.linear.z) <= (limits.vertical_speed or math.inf) * (1 + 1e-9)
    assert abs(clamped.yaw_rate) <= (limits.yaw_rate or math.inf) * (1 + 1e-9)
    cross = velocity.linear.x * clamped.linear.y - velocity.linear.y * clamped.linear.x
    assert abs(cross) <= 1e-6 * (1 + velocity.linear.horizontal() ** 2)


@given(VELOCITIES)
def test_without_limits_nothing_is_changed(velocity):
    assert clamp(velocity, Limits()) == velocity
