"""Points in the site's frame and on Earth become what each kind of robot is told."""

import pytest

from fleet.errors import Refused
from fleet.missions.points import SiteMap, point_trouble
from fleet.model.geodesy import GeoOrigin, GeoPoint, world_from_geo
from fleet.model.geometry import Vector3
from fleet.model.place import Place
from fleet.model.site import Placement
from fleet.model.state import RobotState

ORIGIN = GeoOrigin(47.0, 8.0, 400.0)
HILL = (47.001, 8.001)
SITE = SiteMap({"dock": Place("dock", (1.0, 2.0)), "hill": Place("hill", (*HILL, 12.0), "geodetic")}, ORIGIN)
THERE = world_from_geo(ORIGIN, GeoPoint(*HILL, 400.0))


def robot(*, flies=False, placed=True):
    placement = Placement(Vector3(1.0, 0.0, 0.0), 0.0) if placed else None
    site = Vector3(0.0, 0.0, 3.0)
    return RobotState(
        "r", "t", "toy", "e", 0.0, armed=True if flies else None, site=site, placement=placement
    )


def test_a_place_of_the_site_is_given_in_the_robots_world():
    assert SITE.position("dock", robot()) == {"position": [0.0, 2.0]}
    assert SITE.position([1, 2, 5], robot(flies=True)) == {"position": [0.0, 2.0, 5.0]}


def test_an_aircraft_keeps_its_height_where_none_is_given():
    assert SITE.position("dock", robot(flies=True)) == {"position": [0.0, 2.0, 3.0]}


@pytest.mark.parametrize("point", ["hill", {"lat": HILL[0], "lon": HILL[1], "alt": 12.0}])
def test_an_aircraft_is_sent_a_height_above_the_take_off_point_on_earth(point):
    position = SITE.position(point, robot(flies=True))
    assert position == {"geodetic_position": {"latitude": HILL[0], "longitude": HILL[1], "altitude": 12.0}}
    assert SITE.height(point) == 12.0


@pytest.mark.parametrize("point", ["hill", {"lat": HILL[0], "lon": HILL[1]}])
def test_a_robot_on_the_ground_is_sent_the_same_point_in_its_world(point):
    (position,) = SITE.position(point, robot()).values()
    assert position == pytest.approx([THERE.x - 1.0, THERE.y])


def test_without_an_origin_nobody_knows_where_a_point_on_earth_is():
    with pytest.raises(Refused, match="the site's position on Earth is unknown"):
        SiteMap().position({"lat": 47.0, "lon": 8.0}, robot())


def test_a_place_that_there_is_not_and_a_robot_that_nobody_placed_are_refused():
    with pytest.raises(Refused, match="there is no place 'moon'"):
        SITE.position("moon", robot())
    with pytest.raises(Refused, match="r is not placed in the site's frame"):
        SITE.position("dock", robot(placed=False))


@pytest.mark.parametrize(
    "value",
    [
        *(None, 7, "x", [], [1], [1, 2, 3, 4], [1, "x"], [1, True], [1, float("nan")], {}, {"lat": 1}),
        *(
            {"lat": 1, "lon": 2, "z": 3},
            {"lat": "1", "lon": 2},
            {"lat": 90, "lon": 0},
            {"lat": 0, "lon": 181},
        ),
    ],
)
def test_what_is_no_point_is_refused(value):
    assert point_trouble(value)


@pytest.mark.parametrize(
    "value", [[1, 2], [1.5, 2, 3], {"lat": 47, "lon": 8}, {"lat": 47, "lon": 8, "alt": 3}]
)
def test_what_is_a_point_is_taken(value):
    assert point_trouble(value) == ""
