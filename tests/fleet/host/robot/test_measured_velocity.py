"""Velocity measured from positions: over several of them, and only as long as they keep coming."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.host.robot.measured_velocity import GAP, MEASURED, MeasuredVelocity
from fleet.model.geometry import Vector3

PERIOD = 0.125  # s between two poses


def measured(positions, velocity=None, now=0.0):
    """Return the measurement after positions that come every ``PERIOD`` s from ``now`` on."""
    velocity = velocity or MeasuredVelocity()
    for number, at in enumerate(positions):
        velocity.observe(at, now + number * PERIOD)
    return velocity


def ahead(speed, count, start=0.0):
    return [Vector3(start + speed * PERIOD * number) for number in range(count)]


def test_a_robot_without_a_position_has_no_velocity():
    assert MeasuredVelocity().value == Vector3()


def test_the_first_position_is_no_motion_from_the_origin():
    velocity = MeasuredVelocity()
    velocity.observe(Vector3(50.0), 1000.0)
    assert velocity.value == Vector3()


@given(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0), st.floats(-10.0, 10.0))
def test_a_constant_velocity_is_measured_in_each_axis(x, y, z):
    steps = [Vector3(x, y, z).scaled(PERIOD * number) for number in range(10)]
    found = measured(steps, now=1000.0).value
    assert (found.x, found.y, found.z) == (pytest.approx(x), pytest.approx(y), pytest.approx(z))


def test_it_is_measured_over_several_positions_so_that_noise_does_not_count():
    velocity = measured(ahead(1.0, 9), now=1000.0)
    velocity.observe(Vector3(1.1), 1000.0 + 8 * PERIOD + MEASURED / 2)  # 10 cm too far
    assert velocity.value.x == pytest.approx(1.0)


def test_after_a_gap_it_is_measured_anew():
    velocity = measured(ahead(2.0, 9), now=1000.0)
    velocity.observe(Vector3(100.0), 1000.0 + 8 * PERIOD + GAP + 0.01)
    assert velocity.value == Vector3()


def test_a_position_at_the_end_of_the_gap_still_counts():
    velocity = measured(ahead(2.0, 9), now=1024.0)
    velocity.observe(Vector3(2.0 * 8 * PERIOD + 3.0), 1024.0 + 8 * PERIOD + GAP - 0.01)
    assert velocity.value.x == pytest.approx(3.0 / (GAP - 0.01))
