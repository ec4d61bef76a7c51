"""Planes and VTOLs on PX4: which flavour one has at the moment, and how a transition is stopped."""

import math

import pytest

from fleet import GeoPoint
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.messages import CommandLong
from fleet_mavlink.px4_plane import Px4Plane, Px4Vtol, Px4VtolForward, Px4VtolInTransition, px4_plane_of
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vocabulary import ON_WINGS

PLACE = GeoPoint(47.3977421, -8.5455941, 503.0)


@pytest.mark.parametrize("kind", range(19, 26))
@pytest.mark.parametrize(
    ("vtol", "name"),
    [
        (None, "Px4VtolForward"),
        (0, "Px4VtolForward"),
        (1, "Px4VtolInTransition"),
        (2, "Px4Vtol"),
        (3, "Px4Vtol"),
        (4, "Px4VtolForward"),
        (99, "Px4VtolForward"),
    ],
)
def test_a_vtol_is_on_its_wings_unless_it_says_otherwise(kind, vtol, name):
    assert type(px4_plane_of(kind, VehicleState(vtol_state=vtol))).__name__ == name


@pytest.mark.parametrize("kind", [1, 18, 26])
@pytest.mark.parametrize("vtol", [None, 0, 1, 3, 4])
def test_another_type_is_a_plane_whatever_it_reports_of_rotors(kind, vtol):
    assert type(px4_plane_of(kind, VehicleState(vtol_state=vtol))) is Px4Plane


@pytest.mark.parametrize("flavour", [Px4Plane(), Px4VtolForward(), Px4VtolInTransition()])
def test_on_its_wings_a_goal_has_no_heading(flavour):
    sent = flavour.go_command(PLACE, 488.0, 15.0, 1.0)
    assert math.isnan(sent.param4)
    assert (sent.param1, sent.x, sent.y, sent.z) == (15.0, 473_977_421, -85_455_941, 503.0)


def test_in_its_hover_a_goal_has_a_heading():
    assert Px4Vtol().go_command(PLACE, 488.0, 3.0, 1.0).param4 == 1.0


def test_a_stop_in_a_transition_goes_back_to_the_hover_first_and_holds_all_the_same_if_that_is_refused():
    flavour, state = Px4VtolInTransition(), VehicleState(vtol_state=1)
    back, hold = flavour.brakes(state)
    assert [each.command for each in back.requests] == [MavCmd.DO_VTOL_TRANSITION, MavCmd.DO_REPOSITION]
    assert back.requests[0] == CommandLong(MavCmd.DO_VTOL_TRANSITION, param1=3.0)
    assert [each.command for each in hold.requests] == [MavCmd.DO_REPOSITION]
    assert {*back.modes, *hold.modes} == {"AUTO.LOITER"}
    assert flavour.holding(state) == back
    assert flavour.goes_over


@pytest.mark.parametrize("flavour", [Px4Plane(), Px4Vtol(), Px4VtolForward()])
def test_otherwise_it_is_stopped_by_its_hold_alone(flavour):
    (brake,) = flavour.brakes(VehicleState())
    assert brake.first is None
    assert not flavour.goes_over


@pytest.mark.parametrize(
    ("flavour", "vtol", "stands"),
    [(Px4Vtol(), 3, True), (Px4Vtol(), 2, True), (Px4Vtol(), 4, False), (Px4Plane(), 3, False)],
)
def test_only_a_hover_stands(flavour, vtol, stands):
    assert flavour.stands(VehicleState(vtol_state=vtol)) is stands


def test_a_vtol_reads_what_its_wings_need_already_in_its_hover():
    wanted = ("NAV_LOITER_RAD", "FW_AIRSPD_MIN", "FW_AIRSPD_TRIM", "FW_AIRSPD_MAX")
    assert Px4Vtol().settings == Px4VtolForward().settings == wanted


@pytest.mark.parametrize(
    ("flavour", "transition", "strafe"),
    [
        (Px4Plane(), False, False),
        (Px4Vtol(), True, True),
        (Px4VtolForward(), True, False),
        (Px4VtolInTransition(), True, False),
    ],
)
def test_wings_take_no_velocities_and_only_a_vtol_changes_its_flight(flavour, transition, strafe):
    assert ("transition" not in flavour.lacking, "strafe_left" not in flavour.lacking) == (transition, strafe)
    assert bool(flavour.transitions) is transition
    if not strafe:
        assert flavour.lacking["strafe_left"] == ON_WINGS


@pytest.mark.parametrize(
    ("flavour", "hovers"), [(Px4Plane(), True), (Px4VtolForward(), False), (Px4Vtol(), False)]
)
def test_a_plane_comes_home_to_circle_and_a_vtol_to_land(flavour, hovers):
    assert flavour.hovers_at_home is hovers
