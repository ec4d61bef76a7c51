"""Manoeuvres of a plane: it rolls, circles and never stands."""

import math

import pytest

ACCEPTED = 0
MODES = {"LOITER": 12, "TAKEOFF": 13, "GUIDED": 15}


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
