"""What pages are told: what changed since they looked, in the site's frame, and nothing twice."""

import math

import pytest

from fleet.console.fleet_view import MOST_STOPS, FleetView, GoalEntry, Goals, RobotPath
from fleet.model.geometry import Vector3, quaternion_from_yaw
from fleet.model.report import PoseReport
from fleet.model.site import Placement
from fleet.model.state import EdgeState, RobotState


def state(stamp=1.0, **fields):
    return RobotState("rex", "twin-1", "toy", "yard", stamp, **fields)


@pytest.fixture
def view():
    return FleetView()


def test_a_page_gets_what_changed_since_it_looked(view):
    view.update_state(state(), 10.0)
    seen = view.version
    assert list(view.since(0)["robots"]) == ["yard/rex"]
    assert view.since(seen) == {}
    view.update_edge(EdgeState("yard", "1.0", 1.0, 5.0), 10.0)
    assert list(view.since(seen)) == ["edges"]


def test_what_is_the_same_as_before_is_no_news(view):
    view.update_state(state(), 10.0)
    seen = view.version
    view.update_state(state(), 10.0)
    assert view.version == seen


def test_an_older_state_is_left_alone(view):
    view.update_state(state(stamp=2.0, mode="new"), 10.0)
    view.update_state(state(stamp=1.0, mode="old"), 10.0)
    assert view.get("robots", "yard/rex")["mode"] == "new"


def test_a_pose_is_turned_into_the_sites_frame_of_a_robot_that_is_placed(view):
    placement = Placement(Vector3(10.0, 0.0), math.pi / 2)
    view.update_state(state(placement=placement), 10.0)
    view.update_pose("twin-1", PoseReport(1.0, Vector3(2.0, 0.0), quaternion_from_yaw(0.0)))
    assert view.get("poses", "yard/rex") == pytest.approx([10.0, 2.0, 0.0, 1.571, True], abs=1e-3)


def test_a_pose_of_a_robot_that_is_not_placed_is_marked_as_its_own(view):
    view.update_state(state(), 10.0)
    view.update_pose("twin-1", PoseReport(1.0, Vector3(2.0), quaternion_from_yaw(0.0)))
    assert view.get("poses", "yard/rex")[4] is False


def test_a_pose_of_a_twin_that_nobody_knows_is_left_out(view):
    view.update_pose("twin-2", PoseReport(1.0, Vector3(), quaternion_from_yaw(0.0)))
    assert view.since(0) == {}


def test_a_way_is_shown_until_it_ends(view):
    view.update_goals("yard", Goals((GoalEntry(RobotPath("rex", (Vector3(1.0, 2.0),))),)))
    assert view.get("goals", "yard/rex") == [[1.0, 2.0, 0.0]]
    view.update_goals("yard", Goals((GoalEntry(RobotPath("rex")), GoalEntry(RobotPath("max")))))
    assert (view.get("goals", "yard/rex"), view.get("goals", "yard/max")) == ([], None)


def test_an_edge_that_goes_is_shown_as_gone_with_its_last_words(view):
    view.update_edge(EdgeState("yard", "1.0", 1.0, 5.0), 10.0)
    view.set_edge_state("yard", alive=False, problem="it has gone", now=11.0)
    shown = view.get("edges", "yard")
    assert (shown["alive"], shown["problem"], shown["version"]) == (False, "it has gone", "1.0")


def test_stops_are_bounded(view):
    for number in range(MOST_STOPS + 5):
        view.update_stop(str(number), {"open": False})
    assert list(view.since(0)["stops"]) == [str(number) for number in range(5, MOST_STOPS + 5)]


def test_robots_are_found_by_edge_and_name(view):
    view.update_state(state(), 10.0)
    assert [found.name for found in view.named(["yard/rex", "yard/max", "rex"])] == ["rex"]
