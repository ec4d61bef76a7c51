"""A plane on PX4 1.16.1: runway take-off, circles, landing where it is."""

import math

import pytest

from fleet_mavlink.sim.mission_items import Item

ACCEPTED, REJECTED = 0, 1
NAN = math.nan


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


@pytest.fixture
def flying(bench):
    """Let a plane take off to 30 m, and circle."""
    it = bench("px4", vehicle="plane")
    it.run(0.5)
    assert it.requests(400, 1) == [ACCEPTED]
    assert it.requests(22, NAN, 0, 0, NAN, NAN, NAN, 518.0) == [ACCEPTED]
    it.until(lambda: it.mode == "LOITER")
    return it


def test_it_takes_off_along_a_runway_and_reports_it_as_it_rolls(bench):
    it = bench("px4", vehicle="plane")
    it.run(0.5)
    it.requests(400, 1)
    it.requests(22, NAN, 0, 0, NAN, NAN, NAN, 518.0)
    it.until(lambda: "Takeoff on runway\t" in it.texts)
    assert it.pilot.land_detector.landed
    it.until(lambda: "Takeoff detected\t" in it.texts)
    assert 5.5 < it.body.speed < 10.0
    assert it.pilot.land_detector.state() == 3
    it.until(lambda: it.mode == "LOITER")
    assert it.texts.count("Takeoff detected\t") == 1
    assert it.height == pytest.approx(30.0, abs=1.0)
    assert it.pilot.land_detector.state() == 2


def test_a_take_off_in_the_air_is_a_circle(flying):
    north = flying.body.north
    assert flying.requests(22, NAN, 0, 0, NAN, NAN, NAN, 600.0) == [ACCEPTED]
    flying.run(10.0)
    assert flying.mode == "LOITER"
    assert abs(flying.body.north - north) < 250.0


def test_a_goal_is_circled_three_metres_below_its_height_at_its_speed(flying):
    assert flying.requests(192, 18.0, 1, 0, NAN, 47.4013, 8.545594, 530.0) == [ACCEPTED]
    circle = flying.pilot.manoeuvre
    assert (circle.north, circle.east) == pytest.approx((395.6, 0.0), abs=1.0)
    assert circle.down == pytest.approx(-39.0, abs=0.1)
    assert circle.speed == 18.0
    assert flying.requests(192, -1.0, 0, 0, NAN, 47.4013, 8.545594, 530.0) == [3]


def test_a_goal_without_a_place_keeps_its_own_and_a_hold_keeps_its_circle(flying):
    flying.requests(192, -1, 1, 0, NAN, 47.4013, 8.545594, 530.0)
    circle = flying.pilot.manoeuvre
    assert flying.set_mode("LOITER") == [ACCEPTED, ACCEPTED]
    assert flying.pilot.manoeuvre is circle
    assert flying.requests(186, 540.0) == [ACCEPTED]
    assert flying.pilot.manoeuvre.down == pytest.approx(-49.0, abs=0.1)
    assert flying.pilot.manoeuvre.north == pytest.approx(flying.body.north, abs=3.0)


def test_on_its_way_home_it_circles_over_it_and_not_lower_than_it_is(flying):
    flying.set_param("RTL_RETURN_ALT", 60)
    assert flying.requests(20) == [ACCEPTED]
    assert flying.pilot.manoeuvre.down == pytest.approx(flying.pilot.home.ned()[2] - 60.0, abs=0.1)
    flying.set_param("RTL_RETURN_ALT", 10)
    flying.requests(192, -1, 1, 0, NAN, NAN, NAN, NAN)
    assert flying.requests(20) == [ACCEPTED]
    assert flying.pilot.manoeuvre.down == pytest.approx(flying.body.down, abs=1.0)


def test_setpoints_have_no_effect_and_never_stop_it(flying):
    flying.stream(0.5, 0.0)
    flying.set_mode("OFFBOARD")
    flying.stream(4.0, 0.0)
    assert flying.body.speed > flying.body.slowest


def test_its_speeds_are_those_of_its_wings(flying):
    speeds, params = flying.pilot.speeds, flying.pilot.params
    assert (speeds.cruise, speeds.climb) == (params["FW_AIRSPD_TRIM"], params["FW_T_CLMB_R_SP"])
    assert (speeds.sink, speeds.takeoff) == (params["FW_T_SINK_R_SP"], speeds.climb)
    speeds.requested = 12.0
    assert speeds.cruise == 12.0
    assert (flying.pilot.circle_radius, flying.pilot.passes_within) == (params["NAV_LOITER_RAD"], 25.0)
