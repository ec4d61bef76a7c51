import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import Quaternion, Vector3
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.measured import ZEROS, BodyMeasurement, MeasuredImu
from fleet_quadruped.body.odometry import LegOdometry, body_twist

PLACES = ((0.2, 0.1), (0.2, -0.1), (-0.2, 0.1), (-0.2, -0.1))
WEST = Quaternion(0.0, 0.0, 0.0, 1.0)
speeds = st.floats(-1, 1)


def feet(twist, places=PLACES):
    """Return how feet move in the body while they rest on the ground."""
    return [(x, y, -(twist.x - twist.turn * y), -(twist.y + twist.turn * x)) for x, y in places]


@given(speeds, speeds, speeds)
def test_resting_feet_tell_the_velocity_of_the_body(x, y, turn):
    found = body_twist(feet(Twist(x, y, turn)), None)
    assert tuple(found) == pytest.approx((x, y, turn), abs=1e-9)


@given(speeds, speeds, speeds)
def test_one_foot_is_enough_when_the_turn_is_known(x, y, turn):
    found = body_twist(feet(Twist(x, y, turn), PLACES[:1]), turn)
    assert tuple(found) == pytest.approx((x, y, turn), abs=1e-9)


def test_a_dog_whose_joints_rest_stays_where_it_is(dog):
    odometry = LegOdometry(dog.legs, dog.geometry.foot_radius)
    for _ in range(50):
        odometry.update(0.01, BodyMeasurement(dog.stance(0.27), ZEROS, None), [True] * 4)
    assert (odometry.x, odometry.y, odometry.yaw) == (0.0, 0.0, 0.0)


def test_the_heading_is_the_imus_and_the_way_goes_along_it(dog):
    odometry = LegOdometry(dog.legs, dog.geometry.foot_radius)
    walked = BodyMeasurement(
        dog.stance(0.27), (0.0, 0.5, 0.0) * 4, MeasuredImu(WEST, Vector3(), Vector3(0, 0, 9.81))
    )
    for _ in range(50):
        odometry.update(0.01, walked, [0.25] * 4)
    assert odometry.yaw == pytest.approx(WEST.yaw)
    assert odometry.x == pytest.approx(-math.copysign(math.hypot(odometry.x, odometry.y), odometry.twist.x))


def test_without_a_standing_foot_nothing_is_known(dog):
    odometry = LegOdometry(dog.legs, dog.geometry.foot_radius)
    odometry.update(0.01, BodyMeasurement(dog.stance(0.27), (1.0,) * 12, None), [False] * 4)
    assert odometry.twist == Twist()


def test_a_foot_counts_as_much_as_it_bears():
    resting, sliding = feet(Twist(0.2)), feet(Twist(0.6))
    assert body_twist([resting[0], sliding[1]], 0.0, [0.75, 0.25]).x == pytest.approx(0.3)


def test_how_the_body_sways_over_its_feet_is_no_part_of_its_velocity(dog):
    odometry = LegOdometry(dog.legs, dog.geometry.foot_radius)
    joints = BodyMeasurement(dog.stance(0.27), (0.1, 0, 0, 0.1, 0, 0) * 2, None)
    for _ in range(100):
        odometry.update(0.01, joints, [0.25] * 4)
    swaying = odometry.twist
    assert abs(swaying.y) > 0.01
    for _ in range(100):
        odometry.update(0.01, joints, [0.25] * 4, (swaying.x, swaying.y))
    assert tuple(odometry.twist) == pytest.approx((0, 0, 0), abs=1e-4)
