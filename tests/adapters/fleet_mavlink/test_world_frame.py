"""The autopilot's position and attitude (NED, FRD) in the world around an origin (ENU, FLU)."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import GeoOrigin, GeoPoint, Vector3
from fleet.model.geodesy import geo_from_world
from fleet_mavlink.messages import Heartbeat
from fleet_mavlink.state import Angles, VehicleState
from fleet_mavlink.world_frame import flu_from_frd, origin_of, pose_of

HOME = GeoOrigin(47.397742, 8.545594, 488.0)
PLACE = GeoPoint(HOME.latitude, HOME.longitude, HOME.altitude)
COPTER, ROVER, BOAT = 2, 10, 11


def test_north_is_y_and_a_nose_to_the_north_is_a_quarter_turn():
    place = geo_from_world(HOME, Vector3(0.0, 30.0, 5.0))
    pose = pose_of(VehicleState(position=place, attitude=Angles(0, 0, 0)), HOME)
    assert (pose.position.x, pose.position.y, pose.position.z) == pytest.approx((0, 30, 5), abs=0.01)
    assert pose.rotation.yaw == pytest.approx(math.pi / 2)


def test_east_is_x_and_a_nose_to_the_east_is_no_turn():
    place = geo_from_world(HOME, Vector3(20.0, 0.0, -3.0))
    pose = pose_of(VehicleState(position=place, attitude=Angles(0, 0, math.pi / 2)), HOME)
    assert (pose.position.x, pose.position.y, pose.position.z) == pytest.approx((20, 0, -3), abs=0.01)
    assert pose.rotation.yaw == pytest.approx(0.0)


@given(st.floats(-math.pi, math.pi), st.floats(-180, 180))
def test_a_nose_along_the_worlds_y_axis_is_a_quarter_turn_wherever_that_points(yaw, bearing):
    origin = GeoOrigin(47.0, 8.0, 0.0, heading=bearing)
    ahead = VehicleState(
        position=GeoPoint(47.0, 8.0, 0.0), attitude=Angles(0, 0, math.radians(bearing) + yaw)
    )
    turned = pose_of(ahead, origin).rotation.yaw
    assert math.remainder(turned - (math.pi / 2 - yaw), math.tau) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(("roll", "pitch"), [(0.3, 0.0), (-0.3, 0.0), (0.0, 0.3), (0.0, -0.3)])
def test_a_tilt_stays_the_same_tilt(roll, pitch):
    """With the nose to the east the axes coincide: roll turns about x, a nose that rises about -y."""
    pose = pose_of(VehicleState(position=PLACE, attitude=Angles(roll, pitch, math.pi / 2)), HOME)
    assert pose.rotation.tilt == pytest.approx(0.3)
    assert 2 * math.asin(pose.rotation.x) == pytest.approx(roll, abs=1e-9)
    assert 2 * math.asin(pose.rotation.y) == pytest.approx(-pitch, abs=1e-9)


@pytest.mark.parametrize("known", [{"position": PLACE}, {"attitude": Angles(0, 0, 0)}, {}])
def test_half_a_pose_is_none(known):
    assert pose_of(VehicleState(**known), HOME) is None


def test_the_origin_is_home_at_the_height_of_home():
    state = VehicleState(
        home=GeoPoint(47.0, 8.0, 480.0), position=GeoPoint(47.5, 8.5, 498.0), relative_altitude=10.0
    )
    assert origin_of(state) == GeoOrigin(47.0, 8.0, 488.0)


@pytest.mark.parametrize("kind", [ROVER, BOAT])
def test_the_origin_of_a_vehicle_on_the_surface_is_home_at_the_height_of_the_vehicle(kind):
    state = VehicleState(
        heartbeat=Heartbeat(kind, 3),
        home=GeoPoint(47.0, 8.0, 480.0),
        position=GeoPoint(47.5, 8.5, 498.0),
        relative_altitude=488.0,
    )
    assert origin_of(state) == GeoOrigin(47.0, 8.0, 498.0)


HOME_POINT = GeoPoint(47.0, 8.0, 480.0)


@pytest.mark.parametrize(
    "known",
    [
        {},
        {"home": HOME_POINT},
        {"home": HOME_POINT, "position": PLACE},
        {"home": HOME_POINT, "relative_altitude": 3.0},
        {"position": PLACE, "relative_altitude": 3.0},
        {"heartbeat": Heartbeat(ROVER, 3), "position": PLACE},
        {"heartbeat": Heartbeat(ROVER, 3), "home": HOME_POINT},
        {"heartbeat": Heartbeat(COPTER, 3), "home": HOME_POINT, "position": PLACE},
    ],
)
def test_without_home_and_its_altitude_there_is_no_origin(known):
    assert origin_of(VehicleState(**known)) is None


def test_right_becomes_minus_left_and_down_minus_up():
    assert flu_from_frd(Vector3(1.0, 2.0, 3.0)) == Vector3(1.0, -2.0, -3.0)
