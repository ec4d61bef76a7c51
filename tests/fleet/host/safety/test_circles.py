"""Where a robot circles that cannot stand."""

from fleet.host.safety.circles import circling_radii
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Vector3
from fleet.model.navigation import FlyMission, FollowPath, Goal, GoTo, PlanItem

HERE = Goal(Vector3())
PLACE = GeoPoint(47.0, 8.0, 40.0)


def test_each_goal_is_circled():
    assert list(circling_radii(GoTo(HERE), 90.0)) == [90.0]
    assert list(circling_radii(FollowPath((HERE, HERE)), 90.0))[:2] == [90.0, 90.0]


def test_what_stands_circles_nothing():
    assert list(circling_radii(GoTo(HERE), 0.0)) == []


def test_a_mission_passes_its_waypoints_and_circles_where_it_stays_and_ends():
    items = (
        PlanItem("waypoint", PLACE),
        PlanItem("loiter_time", PLACE, seconds=5.0, radius=120.0),
        PlanItem("waypoint", PLACE),
    )
    assert list(circling_radii(FlyMission("round", items), 90.0)) == [0.0, 120.0, 90.0]
    landing = (PlanItem("loiter_to_altitude", PLACE), PlanItem("land", PLACE))
    assert list(circling_radii(FlyMission("down", landing), 90.0)) == [90.0, 0.0]
    home = (PlanItem("waypoint", PLACE), PlanItem("return_to_launch"))
    assert list(circling_radii(FlyMission("home", home), 90.0)) == [0.0]
