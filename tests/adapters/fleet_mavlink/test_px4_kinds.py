"""Kinds of PX4 vehicles: one table of modes, one brake for all of them, and when each can be armed."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import GeoPoint
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.messages import CommandLong, Heartbeat
from fleet_mavlink.px4 import Px4
from fleet_mavlink.px4_kinds import Px4Kind
from fleet_mavlink.px4_plane import Px4Plane, Px4Vtol
from fleet_mavlink.state import VehicleState

GROUND = Px4Kind()
ALL = pytest.mark.parametrize(
    "kind", [GROUND, Px4(), Px4Plane(), Px4Vtol()], ids=lambda kind: type(kind).__name__
)
HOME = GeoPoint(47.4, 8.5, 488.0)


@pytest.mark.parametrize(
    ("mode", "main", "sub"),
    [
        ("MANUAL", 1, 0),
        ("POSCTL", 3, 0),
        ("ORBIT", 3, 1),
        ("OFFBOARD", 6, 0),
        ("AUTO.TAKEOFF", 4, 2),
        ("AUTO.LOITER", 4, 3),
        ("AUTO.MISSION", 4, 4),
        ("AUTO.RTL", 4, 5),
        ("AUTO.LAND", 4, 6),
        ("AUTO.VTOL_TAKEOFF", 4, 10),
    ],
)
def test_a_mode_is_set_by_its_main_and_its_sub_number(mode, main, sub):
    expected = CommandLong(MavCmd.DO_SET_MODE, param1=1.0, param2=float(main), param3=float(sub))
    assert GROUND.mode_command(mode) == expected


@given(st.sampled_from(sorted(Px4Kind.modes)))
def test_the_numbers_of_a_mode_are_the_bytes_of_its_heartbeat(custom_mode):
    command = GROUND.mode_command(GROUND.mode_name(custom_mode))
    assert int(command.param2) << 16 | int(command.param3) << 24 == custom_mode


@ALL
def test_it_is_braked_by_a_reposition_to_nowhere_which_ends_a_flight_to_a_position_too(kind):
    (brake,) = kind.brakes(VehicleState(heartbeat=Heartbeat(2, 12, 0x80, 0x03040000)))
    assert (brake.mode, brake.first) == ("AUTO.LOITER", None)
    sent = brake.request
    assert isinstance(sent, CommandLong)  # of a COMMAND_INT, nothing marks a missing position
    assert (sent.command, sent.param1, sent.param2) == (MavCmd.DO_REPOSITION, -1.0, 1.0)
    assert all(math.isnan(each) for each in (sent.param4, sent.param5, sent.param6, sent.param7))


def test_only_on_the_ground_or_on_water_may_its_motors_be_switched_off():
    assert GROUND.may_be_disarmed
    assert not Px4().may_be_disarmed
    assert not Px4Vtol().may_be_disarmed


@pytest.mark.parametrize(
    ("flags", "position_at", "attitude_at", "usable"),
    [
        (0x10, 99.5, 99.5, True),
        (None, 99.5, 99.5, True),
        (0x10, 99.0, 99.0, True),
        (0x10, 98.9, 99.5, False),
        (0x10, 99.5, 98.9, False),
        (0x0F, 99.5, 99.5, False),
    ],
)
def test_a_position_is_usable_while_it_and_the_attitude_come_with_good_flags(
    flags, position_at, attitude_at, usable
):
    state = VehicleState(estimator_flags=flags, position_at=position_at, attitude_at=attitude_at)
    assert GROUND.position_usable(state, 100.0) is usable


@pytest.mark.parametrize(
    ("prearm", "home", "ready"),
    [(None, HOME, None), (False, HOME, False), (True, None, False), (True, HOME, True), (None, None, None)],
)
def test_it_can_be_armed_once_the_check_passes_and_home_is_known(prearm, home, ready):
    assert GROUND.ready_to_arm(VehicleState(prearm_ok=prearm, home=home)) is ready


def test_integers_are_sent_as_their_bits_and_motor_speeds_are_not_asked_for():
    assert GROUND.bytewise_parameters
    assert GROUND.motors is None
    assert GROUND.data_streams == ()
