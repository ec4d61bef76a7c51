"""The fence of one robot: where its corners are, and what breaks it."""

import pytest

from fleet.errors import Refused
from fleet.host.robot.fence_keeper import FenceKeeper
from fleet.host.robot.robot_place import STALE, RobotPlace
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Pose, Quaternion, Vector3, Velocity
from fleet.robot_config import FenceConfig, Limits
from fleet.testing.clock import ManualClock

YARD = FenceConfig(inclusion=[[(-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)]])
EARTH = FenceConfig(
    frame="geodetic", inclusion=[[(46.999, 7.999), (47.001, 7.999), (47.001, 8.001), (46.999, 8.001)]]
)
NO_LIMITS = Limits(altitude=None, distance=None)
EAST = Velocity(Vector3(2.0, 0.0, 0.0))


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def place(clock):
    return RobotPlace(None, clock)


def stands(place, x):
    place.observe(Pose(Vector3(x, 0.0, 0.0), Quaternion()))


def test_a_breach_is_reported_once_and_again_after_the_robot_was_inside(place):
    fencing = FenceKeeper(place, YARD, NO_LIMITS)
    reported = []
    for x in (0.0, 30.0, 31.0, 0.0, 30.0):
        stands(place, x)
        reported.append(fencing.check())
    assert reported == [False, True, False, False, True]
    assert fencing.trouble == "outside the fence"


def test_corners_on_earth_are_placed_once_home_is_known(place):
    fencing = FenceKeeper(place, EARTH, NO_LIMITS)
    stands(place, 0.0)
    assert fencing.fence is None
    assert not fencing.check()
    assert not fencing.would_leave(EAST)
    with pytest.raises(Refused, match="the robot's position is unknown"):
        fencing.inside(EAST)
    place.home = GeoPoint(47.0, 8.0, 0.0)
    fencing.draw()
    assert fencing.inside(EAST) == EAST
    assert fencing.fence.trouble(Vector3(500.0), Vector3()) == "outside the fence"


def test_an_old_pose_is_no_ground_to_move_by(place, clock):
    fencing = FenceKeeper(place, YARD, NO_LIMITS)
    stands(place, 0.0)
    clock.advance(STALE + 0.1)
    with pytest.raises(Refused, match="the robot's position is unknown"):
        fencing.inside(EAST)


def test_limits_alone_do_not_hold_a_robot_whose_place_is_unknown(place):
    fencing = FenceKeeper(place, None, Limits(altitude=10.0, distance=None))
    climb = Velocity(Vector3(0.0, 0.0, 1.0))
    assert fencing.inside(climb) == climb
    place.observe(Pose(Vector3(0.0, 0.0, 9.9), Quaternion()))
    assert fencing.inside(climb).linear.z == 0.0
    assert fencing.inside(EAST) == EAST


def test_a_velocity_out_of_the_fence_is_seen_as_one(place):
    fencing = FenceKeeper(place, YARD, NO_LIMITS)
    stands(place, 18.0)
    assert fencing.would_leave(EAST)
    assert not fencing.would_leave(Velocity(Vector3(-2.0, 0.0, 0.0)))


def test_a_robot_is_out_of_no_fence_once_that_is_taken_away(place):
    fencing = FenceKeeper(place, YARD, NO_LIMITS)
    stands(place, 30.0)
    fencing.check()
    fencing.configure(None, NO_LIMITS)
    assert fencing.trouble == ""
    assert fencing.inside(EAST) == EAST


def test_a_velocity_that_is_held_while_the_pose_is_too_old_may_lead_out(place, clock):
    fencing = FenceKeeper(place, YARD, NO_LIMITS)
    stands(place, 0.0)
    assert not fencing.would_leave(EAST)
    clock.advance(STALE + 0.1)
    assert fencing.would_leave(EAST)
    assert not fencing.would_leave(Velocity())
