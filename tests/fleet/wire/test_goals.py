"""Goals for one or several robots: whose frame the numbers count in, and who goes where."""

import math

import pytest

from fleet.errors import Refused
from fleet.model.geodesy import GeoOrigin, GeoPoint, world_from_geo
from fleet.model.geometry import Vector3
from fleet.model.site import Placement
from fleet.model.state import RobotState
from fleet.wire.goals import GotoTarget, goals


def a_robot(name, *, x=0.0, y=0.0, yaw=0.0, placed=True):
    placement = Placement(Vector3(x, y), yaw) if placed else None
    return RobotState(name, "", "", "yard", 0.0, site=Vector3(x, y) if placed else None, placement=placement)


APART = [a_robot("drone-1"), a_robot("drone-2", y=11.0)]
TOGETHER = [a_robot("ugv-1"), a_robot("ugv-2")]


def test_one_point_for_several_robots_is_refused():
    for aim, robots in [
        (GotoTarget(10, 0, 5, "geo"), APART),
        (GotoTarget(10, 0, 5, "site"), APART),
        (GotoTarget(10, 0, 0), TOGETHER),
    ]:
        with pytest.raises(Refused, match="one point for 2 robots") as refused:
            goals(aim, robots)
        assert "--spacing" in refused.value.hint


def test_a_group_goal_over_different_frames_is_refused_with_or_without_spacing():
    for spacing in (None, 3.0):
        with pytest.raises(Refused, match="drone-1 and drone-2 have no frame in common") as refused:
            goals(GotoTarget(10, 0, 5, spacing=spacing), APART)
        assert "--site" in refused.value.hint


def test_a_robot_that_is_not_placed_has_no_place_in_the_site_and_no_frame_in_common():
    lost = a_robot("lost", placed=False)
    with pytest.raises(Refused, match="not placed in the site's frame: lost"):
        goals(GotoTarget(1, 2, 0, "site"), [lost])
    with pytest.raises(Refused, match="no frame in common"):
        goals(GotoTarget(1, 2, 0, spacing=3.0), [lost, a_robot("other", placed=False)])


def test_with_spacing_each_goes_to_the_place_on_its_own_side():
    one, other = goals(GotoTarget(10, 5, 2, "site", spacing=4.0), [a_robot("b", x=19.0), a_robot("a", x=1.0)])
    assert one["position"][:2] != other["position"][:2]
    assert one["position"][0] + 19.0 > 10.0 > other["position"][0] + 1.0
    assert one["action_id"] != other["action_id"]


def test_spacing_on_earth_is_metres_too():
    messages = goals(GotoTarget(47.0, 8.0, 20, "geo", spacing=6.0), APART)
    points = [GeoPoint(*message["geodetic_position"].values()) for message in messages]
    here, there = (world_from_geo(GeoOrigin(47.0, 8.0), point) for point in points)
    assert (here - there).norm() == pytest.approx(6.0, abs=1e-3)
    assert (here + there).horizontal() == pytest.approx(0.0, abs=1e-3)


def test_a_place_and_a_heading_of_the_site_are_turned_into_the_robots_own_world():
    (message,) = goals(
        GotoTarget(10, 5, 1, "site", yaw=math.pi / 2), [a_robot("rex", x=10, y=2, yaw=math.pi / 2)]
    )
    assert message["position"] == pytest.approx([3.0, 0.0, 1.0])
    assert message["yaw"] == pytest.approx(0.0)


def test_a_path_has_the_heading_at_its_end_alone_and_no_height_that_nobody_said():
    aim = GotoTarget(3, 4, frame="site", yaw=1.0, speed=2.0, via=((1.0, 2.0), (2.0, 2.0, 5.0)))
    (message,) = goals(aim, [a_robot("rex", x=1.0)])
    first, second, last = message["waypoints"]
    assert (first, second) == ({"position": [0.0, 2.0]}, {"position": [1.0, 2.0, 5.0]})
    assert last == {"position": [2.0, 4.0], "yaw": 1.0}
    assert (message["constraints"], "position" in message) == ({"max_speed_ms": 2.0}, False)


def test_a_path_on_earth_is_degrees():
    (message,) = goals(GotoTarget(47.0, 8.0, 20.0, "geo", via=((47.1, 8.1),)), [a_robot("kestrel")])
    first, last = (each["geodetic_position"] for each in message["waypoints"])
    assert first == pytest.approx({"latitude": 47.1, "longitude": 8.1})
    assert last == pytest.approx({"latitude": 47.0, "longitude": 8.0, "altitude": 20.0})


def test_one_path_for_several_robots_is_refused():
    with pytest.raises(Refused, match="one path for 2 robots"):
        goals(GotoTarget(1, 2, frame="site", spacing=4.0, via=((0.0, 0.0),)), APART)
