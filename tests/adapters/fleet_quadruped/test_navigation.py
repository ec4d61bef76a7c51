"""The host's follower leads a simulated dog in lock-step: no real time, no waiting."""

import math

import pytest

from fleet import Pose, Quaternion, Vector3
from fleet.host.follow.leg_follower import TOLERANCE, LegFollower
from fleet.host.follow.legs import legs_of
from fleet.host.follow.motion_laws import MotionLimits
from fleet.model.navigation import FollowPath, Goal, GoTo, RelativeMove
from fleet_quadruped import QuadrupedAdapter
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.sim.rig import Rig
from tests.adapters.fleet_quadruped.copies import standing_dog, standing_in_physics

PERIOD = 0.05


def pose_of(rig):
    state = rig.state()
    return Pose(Vector3(state.x, state.y, 0.0), Quaternion(*state.rotation))


def lead(rig, task, within=60.0):
    """Lead a standing dog through a task as the host does; return its pose at the end."""
    limits, now = QuadrupedAdapter.limits, rig.sim.time
    follower = LegFollower(
        legs_of(task, pose_of(rig), None),
        pose_of(rig),
        MotionLimits(limits.speed, limits.yaw_rate * 0.9),
        tolerance=TOLERANCE,
        holonomic=QuadrupedAdapter.holonomic,
        now=now,
    )
    while not follower.done:
        assert rig.sim.time < now + within, (follower.phase, pose_of(rig))
        velocity = follower.step(pose_of(rig), rig.sim.time)
        rig.go(PERIOD, Twist(velocity.linear.x, velocity.linear.y, velocity.yaw_rate))
    rig.go(1.0)
    return pose_of(rig)


@pytest.fixture
def dog_on_its_feet(dog):
    return standing_dog(dog)


@pytest.mark.parametrize(
    ("x", "y", "yaw"), [(1.0, 0.0, None), (0.0, 0.8, 0.0), (-0.6, -0.4, 3.0), (0.7, -0.7, -1.5), (0, 0, 2.0)]
)
def test_a_goal_is_reached_with_its_heading(dog_on_its_feet, x, y, yaw):
    end = lead(dog_on_its_feet, GoTo(Goal(Vector3(x, y), yaw=yaw)))
    assert math.dist((end.position.x, end.position.y), (x, y)) < 0.15
    assert yaw is None or abs(math.remainder(end.rotation.yaw - yaw, math.tau)) < 0.15


def test_a_square_ends_where_it_began(dog_on_its_feet):
    corners = [(0.6, 0.0), (0.6, 0.6), (0.0, 0.6), (0.0, 0.0)]
    end = lead(dog_on_its_feet, FollowPath(tuple(Goal(Vector3(*corner)) for corner in corners)))
    assert math.hypot(end.position.x, end.position.y) < 0.15


def test_a_relative_move_goes_sideways_without_turning(dog_on_its_feet):
    end = lead(dog_on_its_feet, RelativeMove(Vector3(0.0, -0.5)))
    assert (end.position.x, end.position.y) == pytest.approx((0.0, -0.5), abs=0.15)
    assert abs(end.rotation.yaw) < 0.15


def test_a_controller_that_begins_anew_on_a_dog_that_has_turned_leads_it_to_its_goal(dog_on_its_feet):
    rig = dog_on_its_feet
    rig.go(2.5, Twist(turn=0.8))
    rig.request(BodyRequest.SIT)
    rig.go(4.0)
    rig.reconnect()
    rig.stand()
    assert pose_of(rig).rotation.yaw > 1.0
    end = lead(rig, GoTo(Goal(Vector3(0.8, 0.0))))
    assert (end.position.x, end.position.y) == pytest.approx((0.8, 0.0), abs=0.15)


def test_a_dog_without_an_imu_is_led_to_its_goal(dog):
    rig = Rig(dog.model_copy(update={"imu": None}))
    rig.stand()
    end = lead(rig, GoTo(Goal(Vector3(0.0, 0.6), yaw=1.5)))
    assert (end.position.x, end.position.y) == pytest.approx((0.0, 0.6), abs=0.15)
    assert end.rotation.yaw == pytest.approx(1.5, abs=0.15)


def test_in_physics_the_dog_truly_is_at_its_goal(dog):
    rig = standing_in_physics(dog)
    start = rig.sim.world.place()
    lead(rig, GoTo(Goal(Vector3(0.8, 0.4), yaw=0.8)))
    x, y, _ = rig.sim.world.place()
    assert (x - start[0], y - start[1]) == pytest.approx((0.8, 0.4), abs=0.15)
    assert rig.sim.world.imu().rotation.yaw == pytest.approx(0.8, abs=0.15)
