"""A QuadPlane on ArduPlane 4.6.3: its flight states, and GUIDED by its parameter."""

import math

import pytest

from fleet_mavlink.sim.mission_items import Item

ACCEPTED = 0


@pytest.fixture
def hovering(bench):
    it = bench("ardupilot", vehicle="vtol")
    it.run(0.5)
    it.set_param("Q_GUIDED_MODE", 1)
    it.set_mode("GUIDED")
    assert it.requests(400, 1) == [ACCEPTED]
    assert it.requests_int(22, 7, (0, 0, 0, 0), 0.0, 0.0, -30.0) == [ACCEPTED]
    it.until(lambda: it.height > 29.5)
    it.run(2.0)
    return it


def test_a_quadplane_tells_forward_flight_on_the_ground_and_its_hover_in_the_air(bench, hovering):
    on_the_ground = bench("ardupilot", vehicle="vtol")
    on_the_ground.run(0.5)
    assert (on_the_ground.pilot.vtol_state(), hovering.pilot.vtol_state()) == (4, 3)


def test_a_hovering_quadplane_sinks_in_qloiter_without_a_stick(hovering):
    before = hovering.height
    hovering.set_mode("QLOITER")
    hovering.run(4.0)
    assert before - hovering.height > 7.0


def test_a_hovering_quadplane_stands_in_guided_if_it_is_set_so_and_else_flies_forward(hovering):
    hovering.set_mode("QLOITER")
    hovering.set_mode("GUIDED")
    hovering.run(10.0)
    assert hovering.body.speed < 0.5
    hovering.set_mode("QLOITER")
    hovering.set_param("Q_GUIDED_MODE", 0)
    hovering.set_mode("GUIDED")
    hovering.run(10.0)
    assert hovering.body.speed > 10.0
    assert hovering.pilot.vtol_state() == 4


TO_FORWARD, TO_HOVER, HOVERS, FORWARD = 1, 2, 3, 4


def north(metres, height=30.0):
    """Return a place north of where it began, as DO_REPOSITION takes it."""
    return (47.397742 + metres / 111_195, 8.545594, height)


def goes(it, metres, height=30.0):
    return it.requests_int(192, 6, (-1, 1, 0, math.nan), *north(metres, height))


def test_a_near_place_is_hovered_to_and_a_far_one_flown_to_on_its_wings(hovering):
    near = 1.5 * hovering.pilot.slows_within
    assert goes(hovering, near - 5.0) == [ACCEPTED]
    hovering.run(5.0)
    assert hovering.pilot.vtol_state() == HOVERS
    assert hovering.body.speed <= hovering.pilot.params["Q_WP_SPEED"] / 100 + 0.2
    assert goes(hovering, 3000.0) == [ACCEPTED]
    hovering.run(0.5)
    assert hovering.pilot.vtol_state() == TO_FORWARD
    assert "Transition started airspeed 0.2" in hovering.texts
    assert hovering.until(lambda: hovering.pilot.vtol_state() == FORWARD) == pytest.approx(7.5, abs=0.7)
    assert "Transition done" in hovering.texts


def test_a_far_place_ends_in_a_hover_over_it(hovering):
    goes(hovering, 900.0)
    hovering.until(lambda: hovering.body.speed > 12.0)
    hovering.until(lambda: hovering.pilot.vtol_state() == TO_HOVER, 120.0)
    hovering.until(lambda: hovering.pilot.vtol_state() == HOVERS)
    hovering.run(40.0)
    assert hovering.body.speed < 0.5
    assert hovering.body.north == pytest.approx(900.0, abs=3.0)
    assert hovering.mode == "GUIDED"


def test_its_stopping_distance_is_that_of_its_parameters(hovering):
    for cruise, deceleration, metres in ((20.0, 2.0, 100.0), (30.0, 3.0, 150.0)):
        hovering.set_param("AIRSPEED_CRUISE", cruise)
        hovering.set_param("Q_TRANS_DECEL", deceleration)
        assert hovering.pilot.slows_within == pytest.approx(metres)


def test_guided_from_its_wings_stops_at_its_stopping_point(hovering):
    hovering.set_mode("LOITER")
    hovering.run(30.0)
    speed = hovering.body.speed
    before = hovering.body.north, hovering.body.east
    hovering.set_mode("GUIDED")
    hovering.run(40.0)
    assert hovering.body.speed < 0.5
    went = math.dist(before, (hovering.body.north, hovering.body.east))
    assert went == pytest.approx(speed**2 / (2 * hovering.pilot.params["Q_TRANS_DECEL"]), rel=0.25)


def test_guided_again_keeps_what_it_does(hovering):
    goes(hovering, 60.0)
    hovering.run(2.0)
    flown = hovering.pilot.manoeuvre
    hovering.set_mode("GUIDED")
    assert hovering.pilot.manoeuvre is flown
    hovering.pilot.enter(hovering.pilot.modes["GUIDED"])
    assert hovering.pilot.manoeuvre is flown


def test_near_the_speed_at_which_its_rotors_help_it_flies_faster_than_it_was_asked_to(hovering):
    wings = hovering.pilot.airspeeds
    hovering.set_param("Q_ASSIST_SPEED", 13)
    for requested, flown in ((13.9, 15.0), (14.0, 14.0), (18.0, 18.0), (10.0, 15.0)):
        wings.requested = requested
        assert wings.cruise == flown


def test_its_rotors_fly_at_their_own_speed_whatever_is_asked_for(hovering):
    hovering.pilot.speeds.requested = 20.0
    assert hovering.pilot.speeds.cruise == hovering.pilot.params["Q_WP_SPEED"] / 100


def test_it_lands_with_its_rotors_and_disarms(hovering):
    hovering.set_mode("QLAND")
    hovering.until(lambda: hovering.body.grounded, 90.0)
    assert hovering.until(lambda: not hovering.pilot.armed) == pytest.approx(2.0, abs=0.3)
    assert hovering.height == 0.0
    assert hovering.pilot.vtol_state() == FORWARD
    assert "Throttle disarmed" in hovering.texts


def test_armed_in_guided_after_a_landing_it_says_that_it_flies(hovering):
    hovering.set_mode("QLAND")
    hovering.until(lambda: not hovering.pilot.armed, 90.0)
    hovering.set_mode("GUIDED")
    assert hovering.pilot.land_detector.state() == 1
    assert hovering.requests(400, 1) == [ACCEPTED]
    assert hovering.pilot.land_detector.state() == 2
    assert hovering.height == 0.0


def test_it_is_not_armed_in_auto_without_a_take_off_in_its_mission(bench):
    it = bench("ardupilot", vehicle="vtol")
    it.run(0.5)
    zeros = (0.0, 0.0, 0.0, 0.0)
    home, way = Item(0, 16, 1, *zeros, 0, 0, 0.0), Item(3, 16, 1, *zeros, 473_980_000, 85_456_000, 30.0)
    for item, refusals in (
        (way, ["AUTO missing takeoff waypoint"]),
        (Item(3, 84, 1, *zeros, 0, 0, 30.0), []),
    ):
        it.pilot.missions._plans[0] = [home, item]
        it.set_mode("AUTO")
        assert it.pilot.arming.refusals(force=False) == refusals
        assert it.pilot.arming.refusals(force=True) == []
