import math

import pytest

from fleet.errors import Refused
from fleet.host.follow.legs import Leg, legs_of
from fleet.model.geodesy import GeoOrigin, GeoPoint
from fleet.model.geometry import Pose, Vector3, quaternion_from_yaw
from fleet.model.navigation import FollowPath, Goal, GoTo, RelativeMove

HERE = Pose(Vector3(1.0, 1.0), quaternion_from_yaw(math.pi / 2))


def at(x, y, **more):
    return Goal(Vector3(x, y), **more)


def test_a_goal_is_one_leg():
    assert legs_of(GoTo(at(3, 4, yaw=1.0, wait=2.0)), HERE, None) == (Leg(((3, 4),), 1.0, 2.0),)


def test_a_path_is_cut_where_the_robot_is_to_stand():
    task = FollowPath((at(1, 0), at(2, 0, wait=1.0), at(3, 0)), loops=2)
    legs = legs_of(task, HERE, None)
    assert [leg.points for leg in legs] == [((1, 0), (2, 0)), ((3, 0), (1, 0), (2, 0)), ((3, 0),)]


def test_a_move_in_the_body_frame_begins_where_the_robot_looks():
    (leg,) = legs_of(RelativeMove(Vector3(2.0)), HERE, None)
    assert leg.points[0] == pytest.approx((1.0, 3.0))
    assert not leg.backwards


@pytest.mark.parametrize(
    "move", [RelativeMove(Vector3(-1.0)), RelativeMove(Vector3(0, -1), body_frame=False)]
)
def test_a_move_backwards_is_driven_backwards(move):
    (leg,) = legs_of(move, HERE, None)
    assert leg.points[0] == pytest.approx((1.0, 0.0))
    assert leg.backwards


def test_a_place_on_earth_needs_an_origin():
    goal = GoTo(Goal(geo=GeoPoint(47.0001, 8.0)))
    with pytest.raises(Refused, match="origin"):
        legs_of(goal, HERE, None)
    (leg,) = legs_of(goal, HERE, GeoOrigin(47.0, 8.0))
    assert leg.points[0] == pytest.approx((0.0, 11.1), abs=0.1)


@pytest.mark.parametrize(
    "task",
    [GoTo(at(math.nan, 0)), GoTo(at(1e6, 0)), FollowPath(()), FollowPath((at(0, 0),), loops=2000)],
)
def test_what_cannot_be_driven_is_refused(task):
    with pytest.raises(Refused):
        legs_of(task, HERE, None)
