"""At which speed an ArduPlane flies to a place: in its hover or on its wings, or not at all."""

import math

import pytest

from fleet import NotReady, Refused
from fleet_mavlink.ardupilot_plane import QuadPlane
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.messages import CommandLong
from fleet_mavlink.state import VehicleState

HOVERING = QuadPlane()
SPEEDS = {"AIRSPEED_MIN": 10.0, "AIRSPEED_CRUISE": 15.0, "AIRSPEED_MAX": 22.0}
SET_UP = {**SPEEDS, "Q_WP_SPEED": 500.0, "Q_TRANS_DECEL": 2.0, "Q_ASSIST_SPEED": 0.0}


@pytest.mark.parametrize(("speed", "sent"), [(9.9, None), (10.0, 10.0), (15.0, 15.0)])
def test_an_airspeed_is_sent_for_its_wings_and_none_for_its_hover(speed, sent):
    command = HOVERING.command_after_go(speed, VehicleState(vtol_state=3, settings=SET_UP))
    expected = CommandLong(MavCmd.DO_CHANGE_SPEED, param1=0.0, param2=sent, param3=-1.0) if sent else None
    assert command == expected
    assert HOVERING.command_after_go(speed, VehicleState(vtol_state=3)) is None


NEAR = 0.9 * 1.5 * 15.0**2 / (2 * 2.0)  # m: beyond it is flown on the wings


@pytest.mark.parametrize(
    ("metres", "limit", "wanted", "speed"),
    [
        (NEAR, 30.0, None, 5.0),
        (NEAR + 0.1, 30.0, None, 15.0),
        (NEAR + 0.1, 12.0, None, 12.0),
        (math.inf, None, 99.0, 22.0),
        (NEAR, 5.0, None, 5.0),
        (1.5, 30.0, 1.0, 5.0),  # it is there already
    ],
)
def test_a_near_place_is_reached_in_hover_and_a_far_one_on_the_wings(metres, limit, wanted, speed):
    assert HOVERING.speed_to(VehicleState(vtol_state=3, settings=SET_UP), limit, wanted, metres) == speed


@pytest.mark.parametrize(
    ("metres", "limit", "wanted", "reason", "hint"),
    [
        (70.0, 4.0, None, "flies at 5 m/s (Q_WP_SPEED), and it may fly at 4 m/s", "set Q_WP_SPEED to 400"),
        (1.6, 30.0, 3.0, "it may fly at 3 m/s", "set Q_WP_SPEED to 300 or less"),
        (
            160.0,
            6.0,
            None,
            "a goal more than 76 m away is flown on its wings: its limit is 6 m/s",
            "at least 10",
        ),
        (160.0, 30.0, 9.0, "it was asked for 9 m/s", "at least 10"),
    ],
)
def test_a_place_that_it_cannot_fly_to_that_slowly_is_refused_with_a_remedy(
    metres, limit, wanted, reason, hint
):
    with pytest.raises(Refused) as refused:
        HOVERING.speed_to(VehicleState(vtol_state=3, settings=SET_UP), limit, wanted, metres)
    assert reason in refused.value.reason
    assert hint in refused.value.hint


@pytest.mark.parametrize("missing", ["AIRSPEED_CRUISE", "Q_TRANS_DECEL", "Q_WP_SPEED"])
def test_without_its_parameters_no_goal_is_flown(missing):
    settings = {name: value for name, value in SET_UP.items() if name != missing}
    with pytest.raises(NotReady, match="its speeds are not known yet"):
        HOVERING.speed_to(VehicleState(settings=settings), 30.0, None, 100.0)


@pytest.mark.parametrize(("helped", "speed"), [(0.0, 15.0), (-1.0, 15.0), (13.0, 15.0)])
def test_on_its_wings_it_flies_two_metres_a_second_above_where_its_rotors_help(helped, speed):
    state = VehicleState(settings={**SET_UP, "Q_ASSIST_SPEED": helped})
    assert HOVERING.forward.airspeed(state, 30.0, None) == speed


def test_an_airspeed_at_which_its_rotors_help_is_refused_with_the_lowest_that_is_right():
    state = VehicleState(settings={**SET_UP, "Q_ASSIST_SPEED": 13.1})
    with pytest.raises(Refused, match=r"at 15 m/s its rotors help \(Q_ASSIST_SPEED 13.1\)") as refused:
        HOVERING.forward.airspeed(state, 30.0, None)
    assert "at least 15.1 m/s" in refused.value.hint


@pytest.mark.parametrize("helped", [0.0, -1.0])
def test_without_help_of_its_rotors_it_flies_as_slowly_as_its_wings_can(helped):
    settings = {**SET_UP, "AIRSPEED_MIN": 0.5, "Q_ASSIST_SPEED": helped}
    assert HOVERING.forward.airspeed(VehicleState(settings=settings), 0.75, None) == 0.75
