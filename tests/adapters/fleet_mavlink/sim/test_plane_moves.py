"""Manoeuvres of a plane: it rolls, circles and never stands."""

import math
from types import SimpleNamespace

import pytest

from fleet_mavlink.sim.physics import Agility
from fleet_mavlink.sim.plane_moves import (
    Ahead,
    CircleDown,
    CircleManoeuvre,
    LandingApproach,
    RunwayTakeoff,
    Touchdown,
)
from fleet_mavlink.sim.plane_physics import WingedBody

ACCEPTED = 0


@pytest.fixture
def flying(flying_plane):
    return flying_plane


def test_an_armed_plane_waits_for_its_takeoff_and_rolls_before_it_flies(plane):
    plane.run(5.0)
    assert plane.body.speed == 0.0
    plane.set_mode("TAKEOFF")
    plane.until(lambda: plane.height > 1.0)
    assert plane.body.speed > plane.body.slowest
    assert plane.body.north > 10.0


def test_a_held_plane_circles_and_never_stands(flying):
    flying.set_mode("LOITER")
    north, east, height = flying.body.north, flying.body.east, flying.height
    for _ in range(60):
        flying.run(1.0)
        assert flying.body.speed > flying.body.slowest - 0.5
        assert math.hypot(flying.body.north - north, flying.body.east - east) < 200.0
    assert flying.height == pytest.approx(height, abs=3.0)


def plane_of(**body):
    """Return a plane at 15 m/s on a field of its own."""
    speeds = SimpleNamespace(cruise=15.0, climb=3.0, sink=2.0, takeoff=3.0, landing=(1.3, 1.3, 0.0))
    return SimpleNamespace(body=WingedBody(**body), speeds=speeds, agility=Agility(4.0, 3.0, 1.0))


def flown(pilot, manoeuvre, seconds):
    """Fly a manoeuvre; return the seconds until it was done, None if it never was."""
    for step in range(round(seconds * 20)):
        aim = manoeuvre.aim(pilot)
        if manoeuvre.done:
            return step / 20
        pilot.body.advance(aim, pilot.agility, (0.0, 0.0), 0.05)
    return None


@pytest.mark.parametrize("radius", [80.0, -80.0])
def test_a_circle_is_reached_and_flown_along_in_its_direction(radius):
    pilot = plane_of(north=300.0, down=-50.0, vn=15.0)
    circle = CircleManoeuvre(0.0, 0.0, -50.0, radius)
    assert flown(pilot, circle, 60.0) is not None
    turned = 0.0
    for _ in range(600):
        before = math.atan2(pilot.body.east, pilot.body.north)
        pilot.body.advance(circle.aim(pilot), pilot.agility, (0.0, 0.0), 0.05)
        turned += math.remainder(math.atan2(pilot.body.east, pilot.body.north) - before, math.tau)
        assert math.hypot(pilot.body.north, pilot.body.east) == pytest.approx(80.0, abs=30.0)
    assert turned * radius > 0.0
    assert abs(turned) > math.pi


@pytest.mark.parametrize(
    ("off", "height", "done"), [(14.0, 54.0, True), (16.0, 50.0, False), (0.0, 56.0, False)]
)
def test_a_circle_is_reached_near_it_and_near_its_height(off, height, done):
    pilot = plane_of(north=80.0 + off, down=-height, ve=15.0)
    circle = CircleManoeuvre(0.0, 0.0, -50.0, 80.0)
    circle.aim(pilot)
    assert circle.done is done


def test_a_circle_has_its_own_speed_or_that_of_the_plane():
    pilot = plane_of(north=80.0, down=-50.0, ve=15.0)
    for speed, flown_at in ((None, 15.0), (20.0, 20.0)):
        aim = CircleManoeuvre(0.0, 0.0, -50.0, 80.0, speed).aim(pilot)
        assert math.hypot(aim.vn, aim.ve) == pytest.approx(flown_at)


@pytest.mark.parametrize(("height", "vertical"), [(20.0, -3.0), (49.0, -0.5), (50.0, 0.0), (90.0, 2.0)])
def test_a_height_is_approached_within_its_climb_and_its_sink(height, vertical):
    aim = CircleManoeuvre(0.0, 0.0, -50.0, 80.0).aim(plane_of(north=80.0, down=-height, ve=15.0))
    assert aim.vd == pytest.approx(vertical)


def test_a_take_off_lifts_off_above_its_lowest_speed_and_ends_at_its_height():
    pilot = plane_of(heading=1.0)
    takeoff = RunwayTakeoff(-20.0)
    assert takeoff.aim(pilot).vd == 0.0
    while pilot.body.grounded:
        pilot.body.advance(takeoff.aim(pilot), pilot.agility, (0.0, 0.0), 0.05)
    assert pilot.body.speed >= 1.1 * pilot.body.slowest
    assert flown(pilot, takeoff, 60.0) is not None
    assert pilot.body.height == pytest.approx(20.0, abs=0.5)
    assert math.atan2(pilot.body.east, pilot.body.north) == pytest.approx(1.0, abs=0.05)


def test_it_touches_down_slowly_and_rolls_out():
    pilot = plane_of(down=-3.0, vn=15.0)
    landing = Touchdown()
    assert landing.aim(pilot).vd == 0.7
    assert flown(pilot, landing, 60.0) > 3.0
    assert (pilot.body.grounded, pilot.body.speed < 0.5) == (True, True)


def test_it_descends_in_circles_only_down_to_the_flare():
    pilot = plane_of(north=10.0, down=-30.0, vn=15.0)
    down = CircleDown(pilot, 80.0)
    assert down.aim(pilot).vd == 1.3
    assert flown(pilot, down, 120.0) > 27.0 / 1.3
    assert pilot.body.grounded


def test_an_approach_descends_to_its_place_and_beyond_it_keeps_descending():
    pilot = plane_of(north=-400.0, down=-40.0, vn=15.0)
    approach = LandingApproach(0.0, 0.0)
    assert approach.in_air_state == 4
    assert flown(pilot, approach, 120.0) is not None
    assert pilot.body.grounded
    assert abs(pilot.body.north) < 150.0
    high = plane_of(north=-10.0, down=-20.0, vn=15.0)
    beyond = LandingApproach(0.0, 0.0)
    beyond.aim(high)
    high.body.north = 500.0
    assert beyond.aim(high).vd > 0.0


def test_a_transition_goes_straight_ahead():
    aim = Ahead(-50.0).aim(plane_of(down=-50.0, heading=math.pi / 2))
    assert (aim.vn, aim.ve, aim.vd) == pytest.approx((0.0, 15.0, 0.0), abs=1e-9)
