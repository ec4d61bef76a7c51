"""A plane on PX4 1.16.1: runway take-off, circles, landing where it is."""

import math

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
