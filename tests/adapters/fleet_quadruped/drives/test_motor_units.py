"""Joint and motor: sign, offset and ratio both ways, and a target that pulls no harder than it may."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_quadruped.drives.motor_units import Units, near
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.parts import Actuator

ANGLES = st.floats(-6.0, 6.0)


def joint(sign=1, offset=0.0, ratio=1.0, kp=60.0):
    kind = Actuator(limits=(-2.0, 2.0), velocity=20.0, torque=24.0, kp=kp, ratio=ratio)
    return Joint("FL_knee", "a", 3, sign, offset, -2.0, 2.0, kind)


def test_a_geared_motor_turns_faster_and_weaker_than_its_joint():
    units = Units(joint(ratio=6.0))
    assert units.motor(0.5, 1.0, 12.0) == pytest.approx((3.0, 6.0, 2.0))
    assert units.joint(3.0, 6.0, 2.0) == pytest.approx((0.5, 1.0, 12.0))


def test_a_motor_that_turns_the_other_way_has_all_signs_reversed():
    assert Units(joint(sign=-1)).motor(0.5, 1.0, 12.0) == pytest.approx((-0.5, -1.0, -12.0))


def test_an_offset_is_the_motors_angle_at_joint_zero_and_moves_no_speed_or_torque():
    units = Units(joint(sign=-1, offset=0.2, ratio=6.0))
    assert units.motor(0.0, 0.0, 0.0) == pytest.approx((1.2, 0.0, 0.0))
    assert units.joint(1.2, 6.0, 1.0) == pytest.approx((0.0, -1.0, -6.0))


@given(st.sampled_from([-1, 1]), st.sampled_from([0.0, 0.7, -2.5]), st.sampled_from([0.5, 1.0, 9.1]), ANGLES)
def test_what_is_converted_there_and_back_is_the_same(sign, offset, ratio, angle):
    its, speed, torque = joint(sign, offset, ratio), 3.0 * angle, angle - 5.0
    units = Units(its)
    motor = units.motor(angle, speed, torque)
    assert units.joint(*motor) == pytest.approx((angle, speed, torque), abs=1e-6)
    assert motor[0] == pytest.approx(its.motor(angle), abs=1e-6), "as the joint itself converts it"
    assert motor[1] * motor[2] == pytest.approx(speed * torque, abs=1e-6), "its power is the joint's"


@pytest.mark.parametrize(
    ("target", "most", "moved"),
    [
        (1.0, 6.0, 0.6),  # 6 N m with 60 N m/rad are 0.1 rad
        (0.0, 6.0, 0.4),
        (0.55, 6.0, 0.55),
        (0.6, 6.0, 0.6),
        (1.0, None, 1.0),
        (1.0, 0.0, 0.5),
    ],
)
def test_a_target_is_moved_so_close_that_the_stiffness_pulls_no_harder_than_it_may(target, most, moved):
    assert near(joint(), 0.5, target, most) == pytest.approx(moved)


def test_without_stiffness_no_target_pulls():
    assert near(joint(kp=0.0), 0.5, 2.0, 1.0) == 2.0


@given(ANGLES, ANGLES, st.floats(0.0, 30.0))
def test_a_moved_target_stays_on_its_side_and_within_the_torque(here, target, most):
    moved = near(joint(), here, target, most)
    assert abs(moved - here) * 60.0 <= most + 1e-6
    assert min(here, target) <= moved <= max(here, target)
