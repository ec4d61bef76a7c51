"""Commands of ArduPlane."""

import pytest

from fleet_mavlink.sim.mission_items import Item

ACCEPTED, UNSUPPORTED, FAILED = 0, 3, 4
GUIDED, TAKEOFF = 15, 13


@pytest.fixture
def plane(bench):
    it = bench("ardupilot", vehicle="plane")
    it.run(0.5)
    assert it.requests(176, 1, GUIDED) == [ACCEPTED]
    assert it.requests(400, 1) == [ACCEPTED]
    return it


@pytest.fixture
def flying(plane):
    assert plane.requests(176, 1, TAKEOFF) == [ACCEPTED]
    plane.until(lambda: plane.height > 45.0)
    return plane


def test_a_plane_takes_neither_the_takeoff_nor_the_landing_of_a_multirotor(plane):
    assert plane.requests(22, 0, 0, 0, 0, 0, 0, 20) == [FAILED]
    assert plane.requests(21) == [UNSUPPORTED]
    assert plane.requests(193, 0) == [UNSUPPORTED]


def test_a_plane_takes_airspeeds_between_its_slowest_and_its_fastest(flying):
    assert flying.requests(178, 0, 15, -1) == [FAILED], "not in TAKEOFF"
    flying.requests(176, 1, GUIDED)
    assert flying.requests(178, 0, 15, -1) == [ACCEPTED]
    assert flying.requests(178, 0, 5, -1) == [FAILED]
    assert flying.requests(178, 0, 40, -1) == [FAILED]
    flying.run(10.0)
    assert flying.body.speed == pytest.approx(15.0, abs=0.5)


def test_a_plane_lands_by_the_landing_of_its_mission_and_not_without_one(flying):
    assert flying.requests(189) == [FAILED]
    assert "Unable to start landing sequence" in flying.texts
    place = (473_977_420, 85_455_940)
    zeros = (0.0, 0.0, 0.0, 0.0)
    flying.pilot.missions._plans[0] = [
        Item(0, 16, 1, *zeros, *place, 488.0),
        Item(3, 189, 1, *zeros, 0, 0, 0.0),
        Item(3, 21, 1, *zeros, *place, 0.0),
    ]
    assert flying.requests(189) == [ACCEPTED]
    assert flying.mode == "AUTO"
    flying.until(lambda: not flying.pilot.armed, 300.0)
    assert flying.height == 0.0
