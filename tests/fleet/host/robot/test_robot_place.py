"""Where a robot is and where its tasks lead, in its own world."""

import math

import pytest

from fleet.errors import Refused
from fleet.host.robot.robot_place import STALE, RobotPlace
from fleet.model.geodesy import GeoOrigin, GeoPoint
from fleet.model.geometry import Pose, Vector3, quaternion_from_euler
from fleet.model.navigation import FollowPath, Goal, GoTo, RelativeMove
from fleet.testing.clock import ManualClock

HOME = GeoPoint(47.397742, 8.545594, 488.0)
LEFT = quaternion_from_euler(0.0, 0.0, math.pi / 2)


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def place(clock):
    """Return the place of a robot that is 1 m east and 2 m up, and looks north."""
    place = RobotPlace(None, clock)
    place.observe(Pose(Vector3(1.0, 0.0, 2.0), LEFT))
    return place


def test_a_pose_that_is_too_old_counts_as_unknown(place, clock):
    clock.advance(STALE + 0.1)
    assert place.fresh() is None
    assert place.descent_points("land") == ()
    with pytest.raises(Refused, match=r"the robot's position is unknown.*; try again once it reports one"):
        place.route(GoTo(Goal(Vector3())))


def test_a_move_by_the_body_is_turned_into_the_world(place):
    start, (end,) = place.route(RelativeMove(Vector3(3.0, 0.0, 0.0), body_frame=True))
    assert start == Vector3(1.0, 0.0, 2.0)
    assert (end.x, end.y, end.z) == pytest.approx((1.0, 3.0, 2.0))


def test_a_path_that_is_repeated_leads_back_to_its_first_point(place):
    goals = (Goal(Vector3(1.0)), Goal(Vector3(2.0)))
    assert place.route(FollowPath(goals, loops=1))[1] == (Vector3(1.0), Vector3(2.0))
    assert place.route(FollowPath(goals, loops=2))[1] == (Vector3(1.0), Vector3(2.0), Vector3(1.0))


def test_without_an_origin_home_is_the_origin_of_the_world(place):
    assert place.world() is None
    with pytest.raises(Refused, match="a place on Earth needs an origin"):
        place.route(GoTo(Goal(geo=HOME)))
    place.home = HOME
    assert place.world() == GeoOrigin(HOME.latitude, HOME.longitude, HOME.altitude)
    assert place.home_point() == Vector3()
    (goal,) = place.route(GoTo(Goal(geo=HOME)))[1]
    assert (goal.x, goal.y) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_the_way_home_is_flown_at_the_height_that_it_has_and_ends_at_home(place):
    place.home = HOME
    assert place.descent_points("return_to_home") == (Vector3(0.0, 0.0, 2.0), Vector3())
    assert place.descent_points("land") == (Vector3(1.0, 0.0, 0.0),)
