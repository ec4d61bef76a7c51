"""ArduPlane: which flavour a plane has at the moment, and how each of them is stopped and sent to a place."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import GeoPoint, Vector3, Velocity
from fleet_mavlink.ardupilot_plane import (
    ArduPlane,
    QuadPlane,
    QuadPlaneForward,
    QuadPlaneInTransition,
    UnsetQuadPlaneInTransition,
    arduplane_of,
    reposition,
)
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.messages import CommandInt, CommandLong, Heartbeat
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vocabulary import NO_VELOCITIES

PLANE, HOVERING, FORWARD = ArduPlane(), QuadPlane(), QuadPlaneForward()
HERE = GeoPoint(47.3977, 8.5456, 530.0)
GUIDED, QLAND, LOITER, QHOVER, RTL, CRUISE = 15, 20, 12, 18, 11, 7
SPEEDS = {"AIRSPEED_MIN": 10.0, "AIRSPEED_CRUISE": 15.0, "AIRSPEED_MAX": 22.0}
SET_UP = {**SPEEDS, "Q_GUIDED_MODE": 1.0, "Q_WP_SPEED": 500.0, "Q_TRANS_DECEL": 2.0, "Q_ASSIST_SPEED": 0.0}


def state_of(mode=GUIDED, *, vtol=None, settings=SET_UP, position=HERE, age=0.0, **more):
    beat = Heartbeat(1, 3, 0x80, mode, 4)
    return VehicleState(
        heartbeat=beat,
        heartbeat_at=100.0,
        vtol_state=vtol,
        settings=settings,
        position=position,
        position_at=100.0 - age,
        **more,
    )


def modes(flavour, state):
    return [brake.mode for brake in flavour.brakes(state)]


@pytest.mark.parametrize(
    ("vtol", "guided_hovers", "name"),
    [
        (None, 1.0, "UnknownArduPlane"),
        (0, 1.0, "ArduPlane"),
        (1, 1.0, "QuadPlaneInTransition"),
        (1, 0.0, "UnsetQuadPlaneInTransition"),
        (2, 1.0, "QuadPlane"),
        (2, 0.0, "UnsetQuadPlane"),
        (3, 1.0, "QuadPlane"),
        (3, 0.0, "UnsetQuadPlane"),
        (4, 1.0, "QuadPlaneForward"),
        (4, 0.0, "QuadPlaneWithoutGuidedMode"),
        (99, 1.0, "QuadPlaneForward"),
        (4, None, "QuadPlaneWithoutGuidedMode"),
        (1, None, "UnsetQuadPlaneInTransition"),
    ],
)
def test_its_rotors_its_flight_and_its_parameter_decide_what_it_is(vtol, guided_hovers, name):
    settings = {} if guided_hovers is None else {"Q_GUIDED_MODE": guided_hovers}
    assert type(arduplane_of(state_of(vtol=vtol, settings=settings))).__name__ == name


@pytest.mark.parametrize(("mode", "name"), [(GUIDED, "QuadPlane"), (QHOVER, "UnsetQuadPlane")])
def test_one_that_is_seen_to_hover_in_guided_does_so_before_its_parameter_is_read(mode, name):
    assert type(arduplane_of(state_of(mode, vtol=3, settings={}))).__name__ == name


def test_a_place_is_sent_with_its_height_above_the_sea_and_changes_to_guided():
    sent = reposition(HERE)
    assert (sent.command, sent.frame, sent.param1, sent.param2) == (MavCmd.DO_REPOSITION, 5, -1.0, 1.0)
    assert (sent.x, sent.y, sent.z) == (473_977_000, 85_456_000, 530.0)
    assert math.isnan(sent.param4)
    assert sent == PLANE.go_command(HERE, 488.0, 3.0, 1.0)


def test_a_plane_holds_in_a_circle_around_its_place_and_without_one_in_any_circle():
    assert modes(PLANE, state_of(vtol=0)) == ["LOITER", "CIRCLE"]
    assert PLANE.holding(state_of(vtol=0)).request == PLANE.mode_command("LOITER")


def test_a_plane_lands_by_the_landing_of_its_mission_and_comes_down_only_on_its_way_home():
    assert PLANE.land_command() == CommandLong(MavCmd.DO_LAND_START)
    assert PLANE.comes_down(state_of(RTL))
    assert not PLANE.comes_down(state_of(10))  # AUTO: any mission


def test_a_plane_takes_off_in_its_mode_and_a_quadplane_above_the_place_where_it_stands():
    assert PLANE.takeoff_command(40.0, 488.0) == PLANE.mode_command("TAKEOFF")
    sent = HOVERING.takeoff_command(40.0, 488.0)
    assert (sent.command, sent.frame, sent.z) == (MavCmd.NAV_TAKEOFF, 7, -40.0)


def test_what_a_stop_needs_is_read_first():
    assert PLANE.settings[0] == HOVERING.settings[0] == "Q_GUIDED_MODE"
    assert {*SPEEDS, "WP_LOITER_RAD", "TKOFF_ALT"} <= set(PLANE.settings)
    assert {"Q_WP_SPEED", "Q_TRANS_DECEL", "Q_ASSIST_SPEED"} <= set(HOVERING.settings)


def test_one_of_unknown_kind_is_sent_to_guided_and_else_into_a_circle():
    unknown = arduplane_of(state_of(CRUISE))
    assert modes(unknown, state_of(CRUISE)) == ["GUIDED", "LOITER", "CIRCLE"]
    assert unknown.hold_command(state_of(CRUISE)) == unknown.mode_command("GUIDED")


def test_one_of_unknown_kind_that_is_in_guided_already_is_sent_to_a_place_or_out_of_the_mode_and_back():
    unknown = arduplane_of(state_of())
    assert isinstance(unknown.hold_command(state_of()), CommandInt)
    best = unknown.brakes(state_of(position=None))[0]
    assert best.modes == ("LOITER", "GUIDED")
    assert best.requests == (unknown.mode_command("LOITER"), unknown.mode_command("GUIDED"))


@pytest.mark.parametrize("mode", [17, 18, 19, 20, 21, 22, 23])
def test_one_of_unknown_kind_in_a_mode_of_its_rotors_lands_unless_guided_hovers(mode):
    unknown = arduplane_of(state_of(mode))
    assert modes(unknown, state_of(mode, settings={}))[0] == "QLAND"
    assert modes(unknown, state_of(mode, settings={"Q_GUIDED_MODE": 0.0}))[0] == "QLAND"
    assert modes(unknown, state_of(mode))[0] == "GUIDED"


def test_a_hovering_quadplane_stops_at_its_place_and_without_a_fresh_one_it_lands():
    assert modes(HOVERING, state_of(vtol=3)) == ["GUIDED", "QLAND"]
    assert HOVERING.hold_command(state_of(vtol=3, age=1.5)) == reposition(HERE)
    stale = state_of(vtol=3, age=1.6)
    assert modes(HOVERING, stale) == ["QLAND"]
    assert HOVERING.hold_command(stale) == HOVERING.mode_command("QLAND")


def test_a_quadplane_on_its_wings_circles_and_one_that_is_not_set_up_lands_from_its_hover():
    assert modes(FORWARD, state_of(vtol=4)) == ["LOITER", "CIRCLE"]
    assert FORWARD.hold_command(state_of(vtol=4)) == FORWARD.mode_command("LOITER")
    for vtol in (1, 3):
        state = state_of(vtol=vtol, settings={"Q_GUIDED_MODE": 0.0})
        assert modes(arduplane_of(state), state) == ["QLAND"]
        assert arduplane_of(state).hold_command(state) == HOVERING.mode_command("QLAND")


def test_an_aborted_transition_is_over_once_it_hovers_again():
    assert QuadPlaneInTransition().goes_over
    assert UnsetQuadPlaneInTransition().goes_over
    assert not FORWARD.goes_over
    assert not HOVERING.goes_over


@pytest.mark.parametrize(
    ("vtol", "stands"), [(0, False), (1, False), (2, True), (3, True), (4, False), (None, False)]
)
def test_a_quadplane_stands_while_it_hovers(vtol, stands):
    assert HOVERING.stands(state_of(vtol=vtol)) is stands


def test_no_velocity_is_taken_by_any_of_them():
    forward = Velocity(Vector3(1.0, 0.0, 0.0))
    assert HOVERING.cannot(forward, turns_in_place=True) == NO_VELOCITIES
    assert PLANE.cannot(forward, turns_in_place=True)


@given(st.floats(0.01, 40.0), st.sampled_from([None, 0, 1, 2, 3, 4]), st.floats(0, 359))
def test_it_is_stopped_ahead_of_it_on_its_course_and_never_behind(speed, vtol, course):
    north, east = speed * math.cos(math.radians(course)), speed * math.sin(math.radians(course))
    state = state_of(vtol=vtol, velocity=Vector3(north, east, -2.0))
    sent = HOVERING.to_stand(HERE, state)
    moved = (
        (sent.x / 1e7 - HERE.latitude) * 111_320,
        (sent.y / 1e7 - HERE.longitude) * 111_320 * math.cos(math.radians(HERE.latitude)),
    )
    ahead = HOVERING.goes_on(speed, state)
    assert ahead > 0.0
    assert moved == pytest.approx((north * ahead / speed, east * ahead / speed), rel=0.01, abs=0.05)
    assert sent.z == HERE.altitude


@pytest.mark.parametrize(
    "velocity", [None, Vector3(0.0, 0.0, 3.0), Vector3(math.inf, 0.0, 0.0), Vector3(math.nan, 0, 0)]
)
def test_without_a_speed_over_ground_it_stands_where_it_is(velocity):
    assert HOVERING.to_stand(HERE, state_of(vtol=3, velocity=velocity)) == reposition(HERE)


@pytest.mark.parametrize(
    ("speed", "vtol", "settings", "metres"),
    [
        (5.0, 3, SET_UP, 6.25),  # v2 / 2a at 2 m/s2
        (15.0, 3, SET_UP, 45.0),  # at 1.25 times Q_TRANS_DECEL; as a hover it is 37.5 m
        (30.0, 3, SET_UP, 0.9 * 1.5 * 15.0**2 / 4),  # beyond it would fly there on its wings
        (30.0, 3, {"Q_TRANS_DECEL": 2.0}, 180.0),  # with the fastest cruise while its own is not known
        (10.0, 3, {**SET_UP, "Q_TRANS_DECEL": 1.0}, 40.0),
        (15.0, 3, {}, 45.0),  # Q_TRANS_DECEL is assumed for one with rotors
        (15.0, None, {}, 37.5),
        (15.0, 0, {}, 37.5),
    ],
)
def test_the_distance_of_a_stop_is_what_its_rotors_need(speed, vtol, settings, metres):
    assert HOVERING.goes_on(speed, state_of(vtol=vtol, settings=settings)) == pytest.approx(metres)


def test_out_of_a_transition_its_propeller_pulls_it_on():
    assert QuadPlaneInTransition().goes_on(10.0, state_of(vtol=1)) == pytest.approx(40.0)


@pytest.mark.parametrize(("speed", "slowed"), [(10.0, 7.0), (10.1, 9.09), (20.0, 18.0)])
def test_from_its_wings_less_is_expected_of_it_than_in_its_hover(speed, slowed):
    assert HOVERING.slows_to(speed) == pytest.approx(slowed)


@pytest.mark.parametrize(
    ("flavour", "table"), [(PLANE, "arduplane"), (HOVERING, "quadplane"), (FORWARD, "quadplane")]
)
def test_each_has_its_own_table_of_fail_safes(flavour, table):
    assert flavour.failsafe_table == table


@pytest.mark.parametrize(("flavour", "transition"), [(HOVERING, True), (PLANE, False)])
def test_a_quadplane_that_is_set_up_changes_its_flight_and_a_plane_does_not(flavour, transition):
    assert ("transition" not in flavour.lacking) is transition
    assert bool(flavour.transitions) is transition
