"""Tasks as places on Earth."""

import math

import pytest

from fleet import FollowPath, GeoOrigin, GeoPoint, Goal, GoTo, NotReady, Refused, RelativeMove, Vector3
from fleet.model.geodesy import world_from_geo
from fleet_mavlink.navigation import targets_of
from fleet_mavlink.state import Angles, VehicleState

ORIGIN = GeoOrigin(47.0, 8.0, 500.0)
HERE = VehicleState(position=GeoPoint(47.0, 8.0, 510.0), attitude=Angles(0, 0, 0))


def world(target, origin=ORIGIN):
    place = world_from_geo(origin, target.point)
    return place.x, place.y, place.z


def test_a_world_position_is_above_the_origin():
    (target,) = targets_of(GoTo(Goal(position=Vector3(10, 20, 5))), HERE, ORIGIN)
    assert world(target) == pytest.approx((10, 20, 5), abs=0.01)
    assert target.point.altitude == pytest.approx(505.0)
    assert target.heading is None


def test_a_place_on_earth_is_taken_as_it_is():
    place = GeoPoint(47.001, 8.001, 512.0)
    (target,) = targets_of(GoTo(Goal(geo=place)), HERE, ORIGIN)
    assert target.point == place


@pytest.mark.parametrize(
    ("yaw", "bearing", "heading"), [(0.0, 0.0, 90.0), (math.pi / 2, 0.0, 0.0), (0.0, 30.0, 120.0)]
)
def test_a_yaw_in_the_world_becomes_a_compass_heading(yaw, bearing, heading):
    origin = GeoOrigin(47.0, 8.0, 500.0, heading=bearing)
    (target,) = targets_of(GoTo(Goal(position=Vector3(), yaw=yaw)), HERE, origin)
    assert math.degrees(target.heading) == pytest.approx(heading)


def test_a_path_is_repeated_in_order():
    goals = (Goal(position=Vector3(1, 0, 5), wait=2.0), Goal(position=Vector3(2, 0, 5)))
    targets = targets_of(FollowPath(goals, loops=2), HERE, ORIGIN)
    assert [round(world(target)[0]) for target in targets] == [1, 2, 1, 2]
    assert [target.wait for target in targets] == [2.0, 0.0, 2.0, 0.0]


@pytest.mark.parametrize(("body_frame", "expected"), [(True, (-1, 3, 12)), (False, (3, 1, 12))])
def test_a_relative_move_is_by_the_nose_or_by_the_world(body_frame, expected):
    northward = VehicleState(position=HERE.position, attitude=Angles(0, 0, 0.0))
    (target,) = targets_of(RelativeMove(Vector3(3.0, 1.0, 2.0), body_frame), northward, ORIGIN)
    assert world(target) == pytest.approx(expected, abs=0.01)


def test_a_relative_move_from_an_unknown_place_waits():
    with pytest.raises(NotReady):
        targets_of(RelativeMove(Vector3(1.0, 0.0, 0.0)), VehicleState(), ORIGIN)


@pytest.mark.parametrize(
    "task",
    [
        FollowPath(()),
        FollowPath((Goal(position=Vector3()),), loops=0),
        FollowPath((Goal(position=Vector3()),), loops=10**9),
        GoTo(Goal(position=Vector3(math.nan, 0, 5))),
        GoTo(Goal(position=Vector3(0, 0, math.inf))),
        GoTo(Goal(position=Vector3(0, 0, 5), yaw=math.nan)),
        GoTo(Goal(geo=GeoPoint(91.0, 8.0, 500.0))),
    ],
)
def test_what_cannot_be_flown_is_refused(task):
    with pytest.raises(Refused):
        targets_of(task, HERE, ORIGIN)
