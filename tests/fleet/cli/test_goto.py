"""Sending a robot, or the robots of a group, to a place."""

import json
import math

import pytest

from fleet.cli.goto import Aim, goals
from fleet.errors import Refused
from fleet.model.command import Reply, ReplyStatus
from fleet.model.geodesy import GeoOrigin, GeoPoint, world_from_geo
from fleet.model.geometry import Vector3
from fleet.model.site import Placement
from fleet.model.state import RobotState

TAKEN = Reply("goto", ReplyStatus.ACCEPTED)


def a_robot(name, *, x=0.0, y=0.0, yaw=0.0, placed=True):
    placement = Placement(Vector3(x, y), yaw) if placed else None
    return RobotState(name, "", "", "yard", 0.0, site=Vector3(x, y) if placed else None, placement=placement)


APART = [a_robot("drone-1"), a_robot("drone-2", y=11.0)]
TOGETHER = [a_robot("ugv-1"), a_robot("ugv-2")]


def test_one_point_for_several_robots_is_refused():
    for aim, robots in [
        (Aim(10, 0, 5, "geo"), APART),
        (Aim(10, 0, 5, "site"), APART),
        (Aim(10, 0, 0), TOGETHER),
    ]:
        with pytest.raises(Refused, match="one point for 2 robots") as refused:
            goals(aim, robots)
        assert "--spacing" in refused.value.hint


def test_a_group_goal_over_different_frames_is_refused_with_or_without_spacing():
    for spacing in (None, 3.0):
        with pytest.raises(Refused, match="drone-1 and drone-2 have no frame in common") as refused:
            goals(Aim(10, 0, 5, spacing=spacing), APART)
        assert "--site" in refused.value.hint


def test_a_robot_that_is_not_placed_has_no_place_in_the_site_and_no_frame_in_common():
    lost = a_robot("lost", placed=False)
    with pytest.raises(Refused, match="not placed in the site's frame: lost"):
        goals(Aim(1, 2, 0, "site"), [lost])
    with pytest.raises(Refused, match="no frame in common"):
        goals(Aim(1, 2, 0, spacing=3.0), [lost, a_robot("other", placed=False)])


def test_with_spacing_each_goes_to_the_place_on_its_own_side():
    one, other = goals(Aim(10, 5, 2, "site", spacing=4.0), [a_robot("b", x=19.0), a_robot("a", x=1.0)])
    assert one["position"][:2] != other["position"][:2]
    assert one["position"][0] + 19.0 > 10.0 > other["position"][0] + 1.0
    assert one["action_id"] != other["action_id"]


def test_spacing_on_earth_is_metres_too():
    messages = goals(Aim(47.0, 8.0, 20, "geo", spacing=6.0), APART)
    points = [GeoPoint(*message["geodetic_position"].values()) for message in messages]
    here, there = (world_from_geo(GeoOrigin(47.0, 8.0), point) for point in points)
    assert (here - there).norm() == pytest.approx(6.0, abs=1e-3)
    assert (here + there).horizontal() == pytest.approx(0.0, abs=1e-3)


def test_a_place_and_a_heading_of_the_site_are_turned_into_the_robots_own_world():
    (message,) = goals(Aim(10, 5, 1, "site", yaw=math.pi / 2), [a_robot("rex", x=10, y=2, yaw=math.pi / 2)])
    assert message["position"] == pytest.approx([3.0, 0.0, 1.0])
    assert message["yaw"] == pytest.approx(0.0)


@pytest.fixture
def yard(play_edge):
    robots = {
        name: {"health": "ok", "site": Vector3(x), "placement": Placement(Vector3(x))}
        for name, x in (("rex", -5.0), ("beast", 5.0))
    }
    robots["beast"]["separation"] = "unknown to dog-1"
    return play_edge("yard-1", robots=robots, groups={"ground": ["rex", "beast"]})


def test_a_group_is_sent_nowhere_without_spacing_and_spread_with_it(fleet, yard):
    asked = {name: yard.answers(name, TAKEN) for name in ("rex", "beast")}
    refused = fleet("goto", "ground", "1", "2", "--site")
    assert (refused.code, "one point for 2 robots" in refused.err) == (5, True)
    assert asked == {"rex": [], "beast": []}
    result = fleet("goto", "ground", "0", "2", "--site", "--spacing", "4")
    assert result.code == 0
    places = {name: json.loads(each[0].payload)["position"] for name, each in asked.items()}
    assert places["rex"][0] - 5.0 < 0.0 < places["beast"][0] + 5.0


def test_that_nobody_knows_how_far_a_robot_is_from_another_is_said(fleet, yard):
    yard.answers("beast", TAKEN)
    assert fleet("goto", "beast", "1", "2").err == "beast: separation unknown to dog-1\n"


def test_two_frames_at_once_are_a_usage_error(fleet, yard):
    assert fleet("goto", "rex", "1", "2", "--geo", "--site").code == 2
