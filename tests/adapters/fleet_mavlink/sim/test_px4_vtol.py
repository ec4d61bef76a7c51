"""A VTOL on PX4 1.16.1: a multirotor in hover, a plane on its wings."""

import math

import pytest

ACCEPTED, REJECTED = 0, 1


def test_a_px4_vtol_on_its_wings_cannot_be_armed_on_the_ground(bench):
    it = bench("px4", vehicle="vtol")
    it.run(0.5)
    assert it.requests(3000, 4) == [ACCEPTED]
    assert it.pilot.vtol_state() == 4
    assert it.requests(400, 1) == [REJECTED]
    assert it.requests(3000, 3) == [ACCEPTED]
    assert it.requests(400, 1) == [ACCEPTED]


TO_FORWARD, TO_HOVER, HOVERS, FORWARD = 1, 2, 3, 4
NAN = math.nan


@pytest.fixture
def hovering(bench):
    """Let a VTOL take off to 20 m with its rotors."""
    it = bench("px4", vehicle="vtol")
    it.run(0.5)
    assert it.requests(22, NAN, 0, 0, NAN, NAN, NAN, 508.0) == [ACCEPTED]
    assert it.requests(400, 1) == [ACCEPTED]
    it.until(lambda: it.mode == "LOITER")
    it.run(3.0)
    return it


def test_it_goes_over_along_its_nose_in_three_seconds_and_back_in_one(hovering):
    assert hovering.pilot.vtol_state() == HOVERS
    assert hovering.requests(3000, FORWARD) == [ACCEPTED]
    assert hovering.pilot.vtol_state() == TO_FORWARD
    assert hovering.until(lambda: hovering.pilot.vtol_state() == FORWARD) == pytest.approx(3.1, abs=0.2)
    hovering.run(5.0)
    assert hovering.body.speed > hovering.body.slowest
    assert hovering.requests(3000, HOVERS) == [ACCEPTED]
    assert hovering.pilot.vtol_state() == TO_HOVER
    assert hovering.until(lambda: hovering.pilot.vtol_state() == HOVERS) == pytest.approx(0.9, abs=0.2)
    hovering.run(15.0)
    assert hovering.body.speed < 0.5


def test_a_transition_to_its_wings_is_aborted_at_once(hovering):
    hovering.requests(3000, FORWARD)
    hovering.run(1.0)
    assert hovering.requests(3000, HOVERS) == [ACCEPTED]
    assert hovering.pilot.vtol_state() == HOVERS
    hovering.run(10.0)
    assert hovering.body.speed < 0.5


def test_another_state_is_denied_and_the_one_that_it_has_changes_nothing(hovering):
    for state in (0, 1, 2, 5, NAN):
        assert hovering.requests(3000, state) == [2]
    assert hovering.requests(3000, HOVERS) == [ACCEPTED]
    assert hovering.pilot.vtol_state() == HOVERS


@pytest.mark.parametrize(("command", "mode"), [(21, "LAND"), (20, "RTL")])
def test_it_lands_and_returns_with_its_rotors(hovering, command, mode):
    hovering.requests(3000, FORWARD)
    hovering.run(8.0)
    assert hovering.requests(command) == [ACCEPTED]
    assert (hovering.mode, hovering.pilot.vtol_state()) == (mode, HOVERS)


def test_in_its_hover_it_follows_setpoints_and_on_its_wings_it_does_not(hovering):
    hovering.stream(0.5, 0.0)
    hovering.set_mode("OFFBOARD")
    hovering.stream(3.0, 2.0)
    assert hovering.body.speed == pytest.approx(2.0, abs=0.2)
    hovering.requests(3000, FORWARD)
    hovering.stream(8.0, 0.0)
    assert hovering.body.speed > hovering.body.slowest


def test_a_goal_is_flown_to_as_it_flies(hovering):
    assert hovering.requests(192, 3.0, 1, 0, NAN, 47.3982, 8.545594, 508.0) == [ACCEPTED]
    hovering.run(5.0)
    assert hovering.body.speed == pytest.approx(3.0, abs=0.2)
    hovering.requests(3000, FORWARD)
    hovering.run(5.0)
    assert hovering.requests(192, -1, 1, 0, NAN, 47.4013, 8.545594, 508.0) == [ACCEPTED]
    hovering.run(5.0)
    assert hovering.body.speed > hovering.body.slowest


def test_a_hold_in_transition_does_not_end_it(hovering):
    hovering.requests(3000, FORWARD)
    hovering.run(1.0)
    hovering.requests(192, -1, 1, 0, NAN, NAN, NAN, NAN)
    assert hovering.pilot.vtol_state() == TO_FORWARD
    hovering.run(4.0)
    assert hovering.pilot.vtol_state() == FORWARD
