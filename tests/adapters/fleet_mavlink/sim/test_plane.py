"""Simulated planes, QuadPlanes and VTOLs: what real ones were seen to do, and their refusals."""

import math

import pytest

from fleet_mavlink.sim.mission_items import Item

ACCEPTED, REJECTED = 0, 1
MODES = {"AUTO": 10, "RTL": 11, "LOITER": 12, "TAKEOFF": 13, "GUIDED": 15, "QLOITER": 19, "QLAND": 20}
NAN = math.nan


def enters(it, name):
    return it.requests(176, 1, MODES[name])


@pytest.fixture
def plane(bench):
    it = bench("ardupilot", vehicle="plane")
    it.run(0.5)
    assert enters(it, "GUIDED") == [ACCEPTED]
    assert it.requests(400, 1) == [ACCEPTED]
    return it


@pytest.fixture
def flying(plane):
    assert enters(plane, "TAKEOFF") == [ACCEPTED]
    plane.until(lambda: plane.height > 45.0)
    return plane


@pytest.fixture
def hovering(bench):
    it = bench("ardupilot", vehicle="vtol")
    it.run(0.5)
    it.set_param("Q_GUIDED_MODE", 1)
    enters(it, "GUIDED")
    assert it.requests(400, 1) == [ACCEPTED]
    assert it.requests_int(22, 7, (0, 0, 0, 0), 0.0, 0.0, -30.0) == [ACCEPTED]
    it.until(lambda: it.height > 29.5)
    it.run(2.0)
    return it


def test_an_armed_plane_waits_for_its_takeoff_and_rolls_before_it_flies(plane):
    plane.run(5.0)
    assert plane.body.speed == 0.0
    enters(plane, "TAKEOFF")
    plane.until(lambda: plane.height > 1.0)
    assert plane.body.speed > plane.body.slowest
    assert plane.body.north > 10.0


def test_a_held_plane_circles_and_never_stands(flying):
    enters(flying, "LOITER")
    north, east, height = flying.body.north, flying.body.east, flying.height
    for _ in range(60):
        flying.run(1.0)
        assert flying.body.speed > flying.body.slowest - 0.5
        assert math.hypot(flying.body.north - north, flying.body.east - east) < 200.0
    assert flying.height == pytest.approx(height, abs=3.0)


def test_a_plane_ignores_velocities(flying):
    enters(flying, "GUIDED")
    flying.stream(3.0, 0.0)
    assert flying.body.speed > flying.body.slowest


def test_a_plane_without_its_station_flies_home_and_circles_there(flying):
    flying.set_param("FS_GCS_ENABL", 1)
    flying.set_param("FS_LONG_ACTN", 1)
    flying.set_param("SYSID_MYGCS", 255)
    flying.run(2.0)
    flying.gcs = False
    flying.until(lambda: flying.mode == "RTL", 10.0)
    assert "GCS Failsafe On" in flying.texts
    flying.run(90.0)
    assert math.hypot(flying.body.north, flying.body.east) < 130.0
    assert flying.height > 80.0


def test_a_quadplane_tells_forward_flight_on_the_ground_and_its_hover_in_the_air(bench, hovering):
    on_the_ground = bench("ardupilot", vehicle="vtol")
    on_the_ground.run(0.5)
    assert (on_the_ground.pilot.vtol_state(), hovering.pilot.vtol_state()) == (4, 3)


def test_a_hovering_quadplane_sinks_in_qloiter_without_a_stick(hovering):
    before = hovering.height
    enters(hovering, "QLOITER")
    hovering.run(4.0)
    assert before - hovering.height > 7.0


def test_a_hovering_quadplane_stands_in_guided_if_it_is_set_so_and_else_flies_forward(hovering):
    enters(hovering, "QLOITER")
    enters(hovering, "GUIDED")
    hovering.run(10.0)
    assert hovering.body.speed < 0.5
    enters(hovering, "QLOITER")
    hovering.set_param("Q_GUIDED_MODE", 0)
    enters(hovering, "GUIDED")
    hovering.run(10.0)
    assert hovering.body.speed > 10.0
    assert hovering.pilot.vtol_state() == 4


def test_a_px4_vtol_on_its_wings_cannot_be_armed_on_the_ground(bench):
    it = bench("px4", vehicle="vtol")
    it.run(0.5)
    assert it.requests(3000, 4) == [ACCEPTED]
    assert it.pilot.vtol_state() == 4
    assert it.requests(400, 1) == [REJECTED]
    assert it.requests(3000, 3) == [ACCEPTED]
    assert it.requests(400, 1) == [ACCEPTED]


def test_a_px4_plane_wants_a_landing_in_its_mission(bench):
    it = bench("px4", vehicle="plane")
    it.run(0.5)
    zeros = (0.0, 0.0, 0.0, 0.0)
    it.pilot.missions._plans[0] = [Item(3, 16, 1, *zeros, 473_980_000, 85_460_000, 30.0)]
    assert it.requests(300) == [REJECTED]
    assert "Mission rejected: Landing waypoint/pattern required" in "\n".join(it.texts)
    it.set_param("MIS_TKO_LAND_REQ", 0)
    assert it.requests(300) == [ACCEPTED]


def test_a_px4_plane_circles_down_where_it_is_and_disarms(bench):
    it = bench("px4", vehicle="plane")
    it.run(0.5)
    assert it.requests(400, 1) == [ACCEPTED]
    assert it.requests(22, NAN, 0, 0, NAN, NAN, NAN, 518.0) == [ACCEPTED]
    it.until(lambda: it.mode == "LOITER" and it.height > 29.0)
    north = it.body.north
    assert it.requests(21) == [ACCEPTED]
    it.until(lambda: not it.pilot.armed, 120.0)
    assert abs(it.body.north - north) < 400.0
