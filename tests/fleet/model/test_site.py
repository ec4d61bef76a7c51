"""Worlds of robots in the frame of their site."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.model.geodesy import GeoOrigin, geo_from_world, world_from_geo
from fleet.model.geometry import Pose, Vector3, quaternion_from_yaw, wrap_angle
from fleet.model.site import Placement, placed_at_start, placed_on_earth

SITE = GeoOrigin(47.397742, 8.545594, 488.0)
METRES = st.floats(-5000, 5000)
ANGLE = st.floats(-math.pi, math.pi)
POINT = st.builds(Vector3, METRES, METRES, st.floats(-100, 100))


@given(POINT, ANGLE, POINT)
def test_there_and_back_is_where_it_was(origin, yaw, point):
    placement = Placement(origin, yaw)
    assert (placement.to_world(placement.to_site(point)) - point).norm() < 1e-6


@given(POINT, st.floats(-360, 360), POINT)
def test_a_world_on_earth_lies_where_its_points_are_on_earth(home, heading, point):
    home = geo_from_world(SITE, home)
    world = GeoOrigin(home.latitude, home.longitude, home.altitude, heading)
    there = world_from_geo(SITE, geo_from_world(world, point))
    assert (placed_on_earth(SITE, world).to_site(point) - there).norm() < 0.3


@given(st.tuples(METRES, METRES, ANGLE), POINT, ANGLE)
def test_a_robot_stands_at_its_start_whatever_its_odometry_begins_with(start, position, yaw):
    x, y, heading = start
    placement = placed_at_start(start, Pose(position, quaternion_from_yaw(yaw)))
    at = placement.to_site(position)
    assert (at.x, at.y, at.z) == pytest.approx((x, y, position.z), abs=1e-6)
    assert wrap_angle(yaw + placement.yaw - heading) == pytest.approx(0.0, abs=1e-6)
