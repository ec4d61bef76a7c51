"""A robot is not sent through its fence by a mission: refused at the start, before anything moves."""

import json

import pytest

from fleet.config.load import load
from fleet.host.edge.mission_routes import MissionRoutes, RobotRouteCheck
from fleet.missions.points import SiteMap
from fleet.missions.program import Act
from fleet.model.geodesy import GeoOrigin, geo_from_world
from fleet.model.geometry import Vector3
from fleet.model.place import Place
from fleet.model.site import Placement
from fleet.model.state import RobotState
from fleet.robot_config import AdapterConfig, FenceConfig, Limits

ORIGIN = GeoOrigin(47.0, 8.0, 400.0)
SITE = SiteMap({"gate": Place("gate", (29.0, 0.0))}, ORIGIN)
TWIN = "6f0c9a1e-1111-4111-8111-000000000001"
SQUARE = ((-10.0, -10.0), (20.0, -10.0), (20.0, 10.0), (-10.0, 10.0))
POND = ((4.0, -2.0), (6.0, -2.0), (6.0, 2.0), (4.0, 2.0))
FENCE = FenceConfig(inclusion=(SQUARE,), exclusion=(POND,))


def trouble(act, *, fence=FENCE, placed=True, **fields):
    """Return what is against an act of a robot whose world begins at (10, 0) of the site."""
    config = AdapterConfig(name="r", twin=TWIN, fence=fence, **fields)
    placement = Placement(Vector3(10.0, 0.0, 0.0), 0.0) if placed else None
    state = RobotState(
        "r", TWIN, "toy", "e", 0.0, armed=True, site=Vector3(0.0, 0.0, 5.0), placement=placement
    )
    return RobotRouteCheck(config, SITE).trouble(act, state)


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (Act("goto", [20, 0]), ""),
        (Act("goto", [31, 0]), "goal 1 is outside the fence"),
        (Act("goto", "gate"), ""),
        (Act("goto", [15, 0]), "goal 1 is in an exclusion of the fence"),
        (Act("path", [[12, 0], [12, 5]]), ""),
        (Act("path", [[12, 0], [18, 0]]), "the straight way to goal 2 leads out of the fence"),
        (Act("goto", "moon"), "there is no place 'moon'"),
        (Act("command", "land"), ""),
    ],
)
def test_a_goal_or_a_way_through_the_fence_is_found(act, words):
    assert trouble(act) == words


def test_a_fence_on_earth_is_found_too():
    corners = tuple(
        (geo.latitude, geo.longitude) for geo in (geo_from_world(ORIGIN, Vector3(x, y)) for x, y in SQUARE)
    )
    fence = FenceConfig(frame="geodetic", inclusion=(corners,))
    assert trouble(Act("goto", [19, 0]), fence=fence) == ""
    assert trouble(Act("goto", [21, 0]), fence=fence) == "goal 1 is outside the fence"
    there = geo_from_world(ORIGIN, Vector3(21.0, 0.0))
    point = {"lat": there.latitude, "lon": there.longitude, "alt": 5}
    assert trouble(Act("goto", point), fence=fence) == "goal 1 is outside the fence"


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (Act("goto", [10, 0, 12]), "goal 1 is 12.0 m above home, the limit is 10 m"),
        (Act("goto", [10, 0, 9]), ""),
        (
            Act("goto", {"lat": 47.0, "lon": 8.0, "alt": 12.0}),
            "goal 1 is 12.0 m above home, the limit is 10 m",
        ),
        (Act("command", "takeoff", {"altitude": 12}), "12 m above home, the limit is 10 m"),
        (Act("command", "takeoff", {"altitude": 9}), ""),
    ],
)
def test_the_highest_altitude_is_kept(act, words):
    assert trouble(act, fence=None, limits=Limits(altitude=10.0)) == words


def test_a_robot_that_nobody_placed_is_not_sent_anywhere():
    assert "r is not placed in the site's frame" in trouble(Act("goto", [1, 1]), placed=False)


@pytest.mark.parametrize(
    ("robot", "ahead", "stranger"), [("r", "far", "far"), ("far", "r", "far"), ("r", "r", "")]
)
def test_one_robot_follows_another_of_its_own_edge_only(tmp_path, robot, ahead, stranger):
    config = {
        "edge": {"id": "yard"},
        "robots": [{"name": "r", "twin": TWIN, "adapter": "mavlink", "link": "sim:px4"}],
    }
    (tmp_path / "fleet.yaml").write_text(json.dumps(config))
    state = RobotState("r", TWIN, "mavlink", "yard", 0.0)
    routes = MissionRoutes(load(tmp_path / "fleet.yaml", {}), lambda _: state)
    why = routes.blocker(robot, Act("follow", ahead, {"distance_m": 3.0}))
    wanted = f"{stranger} is a robot of another edge: one follows another of its own edge only"
    assert why == (wanted if stranger else "")
