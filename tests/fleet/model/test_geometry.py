import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from fleet.model.geometry import (
    Quaternion,
    Vector3,
    Velocity,
    enu_rotation_from_ned,
    enu_yaw_from_heading,
    heading_from_enu_yaw,
    ned_from_enu,
    quaternion_from_euler,
    quaternion_from_yaw,
    rotate_to_world,
    wrap_angle,
)

FINITE = st.floats(-1e6, 1e6)
ANGLES = st.floats(-20, 20)
VECTORS = st.builds(Vector3, FINITE, FINITE, FINITE)


def same_angle(one, other):
    return abs(math.remainder(one - other, math.tau)) < 1e-6


def rotated(turn, vector):
    """Return a vector turned by the textbook rotation matrix of a quaternion."""
    w, x, y, z = turn.w, turn.x, turn.y, turn.z
    return Vector3(
        (1 - 2 * (y * y + z * z)) * vector.x
        + 2 * (x * y - w * z) * vector.y
        + 2 * (x * z + w * y) * vector.z,
        2 * (x * y + w * z) * vector.x
        + (1 - 2 * (x * x + z * z)) * vector.y
        + 2 * (y * z - w * x) * vector.z,
        2 * (x * z - w * y) * vector.x
        + 2 * (y * z + w * x) * vector.y
        + (1 - 2 * (x * x + y * y)) * vector.z,
    )


def test_vectors_add_subtract_and_scale_by_component():
    one, other = Vector3(1, 2, 3), Vector3(4, 6, 8)
    assert other - one == Vector3(3, 4, 5)
    assert one + other == Vector3(5, 8, 11)
    assert one.scaled(-2) == Vector3(-2, -4, -6)


def test_lengths_are_euclidean():
    assert Vector3(2, 3, 6).norm() == 7
    assert Vector3(3, 4, 100).horizontal() == 5


@given(ANGLES)
def test_the_yaw_of_a_level_rotation_is_the_one_it_was_made_of(yaw):
    turn = quaternion_from_yaw(yaw)
    assert same_angle(turn.yaw, yaw)
    assert turn.tilt == pytest.approx(0, abs=1e-6)


@given(ANGLES)
def test_a_quaternion_and_its_negative_have_the_same_yaw_and_tilt(yaw):
    turn = quaternion_from_euler(0.3, 0.2, yaw)
    negative = Quaternion(-turn.w, -turn.x, -turn.y, -turn.z)
    assert same_angle(turn.yaw, negative.yaw)
    assert turn.tilt == pytest.approx(negative.tilt)


@given(st.floats(-1.2, 1.2), st.floats(-1.2, 1.2), ANGLES)
def test_euler_angles_give_a_unit_rotation_of_that_yaw(roll, pitch, yaw):
    turn = quaternion_from_euler(roll, pitch, yaw)
    assert math.hypot(turn.w, turn.x, turn.y, turn.z) == pytest.approx(1)
    assert same_angle(turn.yaw, yaw)
    assert math.cos(turn.tilt) == pytest.approx(math.cos(roll) * math.cos(pitch), abs=1e-9)


@pytest.mark.parametrize(
    ("turn", "tilt"),
    [
        (Quaternion(0, 1, 0, 0), math.pi),
        (Quaternion(math.sqrt(0.5), math.sqrt(0.5), 0, 0), math.pi / 2),
        (Quaternion(0, 0, 0, 1), 0),
    ],
)
def test_tilt_is_the_angle_to_the_vertical(turn, tilt):
    assert turn.tilt == pytest.approx(tilt)


@given(st.builds(Quaternion, FINITE, FINITE, FINITE, FINITE))
def test_a_normalized_rotation_has_length_one(turn):
    assume(math.hypot(turn.w, turn.x, turn.y, turn.z) > 1e-3)
    unit = turn.normalized()
    assert math.hypot(unit.w, unit.x, unit.y, unit.z) == pytest.approx(1)


def test_a_rotation_of_length_zero_is_refused():
    with pytest.raises(ValueError, match="length zero"):
        Quaternion(0, 0, 0, 0).normalized()


@given(VECTORS)
def test_ned_from_enu_is_its_own_inverse(vector):
    assert ned_from_enu(ned_from_enu(vector)) == vector
    assert ned_from_enu(vector).norm() == pytest.approx(vector.norm())


def test_east_north_and_up_are_where_they_belong():
    assert ned_from_enu(Vector3(1, 0, 0)) == Vector3(0, 1, 0)
    assert ned_from_enu(Vector3(0, 1, 0)) == Vector3(1, 0, 0)
    assert ned_from_enu(Vector3(0, 0, 1)) == Vector3(0, 0, -1)


@pytest.mark.parametrize(
    ("compass", "yaw"),
    [(0, math.pi / 2), (math.pi / 2, 0), (math.pi, -math.pi / 2), (3 * math.pi / 2, math.pi)],
)
def test_compass_headings_are_clockwise_from_north_and_yaw_is_not(compass, yaw):
    assert enu_yaw_from_heading(compass) == pytest.approx(yaw)
    assert heading_from_enu_yaw(yaw) == pytest.approx(compass)


@given(ANGLES)
def test_heading_and_yaw_are_each_others_inverse(heading):
    assert same_angle(heading_from_enu_yaw(enu_yaw_from_heading(heading)), heading)
    assert 0 <= heading_from_enu_yaw(heading) <= math.tau


@given(st.floats(-1e4, 1e4))
def test_a_wrapped_angle_is_the_same_direction_within_half_a_turn(angle):
    assert -math.pi < wrap_angle(angle) <= math.pi
    assert same_angle(wrap_angle(angle), angle)


def test_half_a_turn_is_always_the_positive_one():
    assert wrap_angle(-math.pi) == math.pi
    assert wrap_angle(math.pi) == math.pi


@given(st.floats(-1.2, 1.2), st.floats(-1.2, 1.2), ANGLES, VECTORS)
def test_an_autopilots_attitude_turns_the_same_vector_to_the_same_place(roll, pitch, yaw, body):
    in_ned = rotated(quaternion_from_euler(roll, pitch, yaw), Vector3(body.x, -body.y, -body.z))
    in_enu = rotated(enu_rotation_from_ned(roll, pitch, yaw), body)
    assert (ned_from_enu(in_enu) - in_ned).norm() <= 1e-9 * max(1.0, body.norm())


@given(VECTORS, ANGLES)
def test_a_level_vector_is_turned_like_by_the_quaternion(vector, yaw):
    difference = rotate_to_world(vector, yaw) - rotated(quaternion_from_yaw(yaw), vector)
    assert difference.norm() <= 1e-9 * max(1.0, vector.norm())


def test_forward_of_a_robot_that_faces_north_is_north():
    moved = rotate_to_world(Vector3(1, 0, 0.5), math.pi / 2)
    assert (moved.x, moved.y, moved.z) == pytest.approx((0, 1, 0.5))


def test_a_velocity_is_zero_only_when_nothing_is_asked_to_move():
    assert Velocity().is_zero
    assert Velocity(Vector3(-0.0)).is_zero
    assert not Velocity(yaw_rate=-0.1).is_zero
    assert not Velocity(Vector3(z=0.1)).is_zero
