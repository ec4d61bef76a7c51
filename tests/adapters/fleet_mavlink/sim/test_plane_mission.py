"""Missions of planes: positions are passed, stays are circles, and a circle counts its turns."""

import math
from types import SimpleNamespace

import pytest

from fleet_mavlink.sim.local_frame import LocalFrame
from fleet_mavlink.sim.mission_items import Item
from fleet_mavlink.sim.physics import Agility
from fleet_mavlink.sim.plane_mission import WingedMission
from fleet_mavlink.sim.plane_moves import FlyOver, LandingApproach, RunwayTakeoff
from fleet_mavlink.sim.plane_physics import WingedBody

PLACE = (47.397742, 8.545594, 488.0)
MAKE = WingedMission.manoeuvres
WAYPOINT, UNLIMITED, TURNS, TIME, LAND, TAKEOFF, TO_HEIGHT = 16, 17, 18, 19, 21, 22, 31


def item(command, *, p1=0.0, p2=0.0, p3=0.0, x=473_977_420, y=85_455_940, z=60.0):
    return Item(3, command, 1, p1, p2, p3, 0.0, x, y, z)


@pytest.fixture
def pilot():
    """Return a plane 60 m above its home, on the circle of 80 m around it."""
    body = WingedBody(north=80.0, down=-60.0, ve=15.0, heading=math.pi / 2)
    return SimpleNamespace(
        body=body,
        place=PLACE,
        frame=LocalFrame(PLACE),
        home=SimpleNamespace(place=PLACE),
        geo=lambda: PLACE,
        speeds=SimpleNamespace(cruise=15.0, climb=3.0, sink=2.0, takeoff=3.0, landing=(1.3, 1.3, 0.0)),
        agility=Agility(4.0, 3.0, 1.0),
        passes_within=25.0,
        circle_radius=80.0,
        time=0.0,
    )


def flown(pilot, manoeuvre, seconds):
    """Fly a manoeuvre; return the seconds until it was done, None if it never was."""
    done = None
    for _ in range(round(seconds * 20)):
        pilot.time += 0.05
        pilot.body.advance(manoeuvre.aim(pilot), pilot.agility, (0.0, 0.0), 0.05)
        done = pilot.time if manoeuvre.done and done is None else done
    return done


@pytest.mark.parametrize(
    ("command", "kind"), [(WAYPOINT, FlyOver), (LAND, LandingApproach), (TAKEOFF, RunwayTakeoff)]
)
def test_each_item_has_its_manoeuvre(pilot, command, kind):
    assert type(MAKE[command](pilot, item(command))) is kind


def test_a_position_is_passed_within_its_distance_and_stays_passed(pilot):
    far = MAKE[WAYPOINT](pilot, item(WAYPOINT, x=473_977_420 + 36_000))  # 400 m north
    done = flown(pilot, far, 60.0)
    assert 15.0 < done < 40.0
    assert far.done
    assert far._within == 25.0


@pytest.mark.parametrize("turns", [1.0, 3.0])
def test_a_circle_is_done_after_its_turns(pilot, turns):
    done = flown(pilot, MAKE[TURNS](pilot, item(TURNS, p1=turns)), 200.0)
    assert done == pytest.approx(turns * math.tau * 80.0 / 15.0, rel=0.1)


def test_a_stay_without_end_is_never_done_and_one_with_an_end_is_when_it_is_reached(pilot):
    assert flown(pilot, MAKE[UNLIMITED](pilot, item(UNLIMITED)), 60.0) is None
    assert flown(pilot, MAKE[TIME](pilot, item(TIME)), 5.0) is not None


@pytest.mark.parametrize(
    ("command", "field", "radius"), [(UNLIMITED, "p3", -120.0), (TIME, "p3", 120.0), (TO_HEIGHT, "p2", 120.0)]
)
def test_an_items_radius_is_that_of_its_circle_and_none_is_the_planes(pilot, command, field, radius):
    assert MAKE[command](pilot, item(command, **{field: radius}))._radius == radius
    assert MAKE[command](pilot, item(command))._radius == 80.0


def test_a_climb_in_a_circle_is_done_at_its_height(pilot):
    done = flown(pilot, MAKE[TO_HEIGHT](pilot, item(TO_HEIGHT, z=90.0)), 60.0)
    assert 25.0 / 3.0 - 1.0 < done < 25.0
    assert pilot.body.height == pytest.approx(90.0, abs=3.0)


def test_a_take_off_climbs_to_its_items_height_above_home(pilot):
    assert MAKE[TAKEOFF](pilot, item(TAKEOFF, z=45.0)).down == pytest.approx(-45.0, abs=0.01)
