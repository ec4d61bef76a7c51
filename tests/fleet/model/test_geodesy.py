import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from fleet.model.geodesy import GeoOrigin, GeoPoint, geo_from_world, world_from_geo
from fleet.model.geometry import Vector3

REACH = st.floats(-10_000, 10_000)
ORIGINS = st.builds(
    GeoOrigin,
    latitude=st.floats(-75, 75),
    longitude=st.floats(-180, 180),
    altitude=st.floats(-400, 5000),
    heading=st.floats(-360, 360),
)
ZURICH = GeoOrigin(47.3769, 8.5417, 408.0)


def ecef(latitude, longitude, altitude):
    """Return Earth-centred coordinates by the textbook formula."""
    a, f = 6378137.0, 1 / 298.257223563
    phi, lam = math.radians(latitude), math.radians(longitude)
    n = a / math.sqrt(1 - f * (2 - f) * math.sin(phi) ** 2)
    x = (n + altitude) * math.cos(phi)
    return x * math.cos(lam), x * math.sin(lam), (n * (1 - f) ** 2 + altitude) * math.sin(phi)


@given(ORIGINS, st.builds(Vector3, REACH, REACH, st.floats(-500, 500)))
def test_a_place_in_reach_survives_the_way_there_and_back(origin, position):
    assert (world_from_geo(origin, geo_from_world(origin, position)) - position).norm() < 1e-3


@given(ORIGINS, REACH, REACH)
def test_horizontal_distances_are_those_of_the_tangent_plane(origin, x, y):
    point = geo_from_world(origin, Vector3(x, y, 0.0))
    here = ecef(origin.latitude, origin.longitude, origin.altitude)
    there = ecef(point.latitude, point.longitude, origin.altitude)
    phi, lam = math.radians(origin.latitude), math.radians(origin.longitude)
    up = (math.cos(phi) * math.cos(lam), math.cos(phi) * math.sin(lam), math.sin(phi))
    offset = [b - a for a, b in zip(here, there, strict=True)]
    height = sum(a * b for a, b in zip(offset, up, strict=True))
    horizontal = math.sqrt(max(0.0, sum(part * part for part in offset) - height**2))
    assert horizontal == pytest.approx(math.hypot(x, y), abs=2e-3)


def test_north_east_and_up_are_where_they_belong():
    assert geo_from_world(ZURICH, Vector3(0, 100, 0)).latitude > ZURICH.latitude
    assert geo_from_world(ZURICH, Vector3(100, 0, 0)).longitude > ZURICH.longitude
    assert geo_from_world(ZURICH, Vector3(0, 0, 7)).altitude == ZURICH.altitude + 7


def test_a_degree_of_latitude_has_its_textbook_length():
    north = world_from_geo(GeoOrigin(45.0, 0.0), GeoPoint(45.01, 0.0)).y
    assert north == pytest.approx(1111.32, abs=0.02)


def test_the_second_axis_points_along_the_origins_heading():
    facing_east = GeoOrigin(ZURICH.latitude, ZURICH.longitude, ZURICH.altitude, heading=90.0)
    east = geo_from_world(ZURICH, Vector3(100, 0, 0))
    moved = world_from_geo(facing_east, east)
    assert (moved.x, moved.y) == pytest.approx((0, 100), abs=1e-6)


def test_the_date_line_is_no_wall():
    origin = GeoOrigin(-17.0, 179.9999)
    point = geo_from_world(origin, Vector3(100, 0, 0))
    assert point.longitude < -179
    assert world_from_geo(origin, point).x == pytest.approx(100)


@given(ORIGINS, REACH, REACH)
def test_level_flight_stays_level(origin, x, y):
    assume(abs(origin.altitude) < 1e4)
    assert geo_from_world(origin, Vector3(x, y, 30.0)).altitude == pytest.approx(origin.altitude + 30.0)
