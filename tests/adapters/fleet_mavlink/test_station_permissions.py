"""What a ground station may send, as tables."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.ardupilot import ArduCopter
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.px4 import Px4
from fleet_mavlink.state import VehicleState
from fleet_mavlink.station_permissions import RequiredPermission, required_permission

NAN = math.nan
COPTER = [brake.request for brake in ArduCopter().brakes(VehicleState())]
PX4 = [*(brake.request for brake in Px4().brakes(VehicleState())), Px4().mode_command("AUTO.LOITER")]
BRAKE, LOITER = 17, 5


def requested(command, *params):
    return mav.MAVLink_command_long_message(1, 1, command, 0, *(*params, *([0.0] * (7 - len(params)))))


FENCE = 1  # mission_type


def file_message(opcode):
    payload = struct.pack("<HBBBBBxI", 7, 3, opcode, 0, 0, 0, 0).ljust(251, b"\0")
    return mav.MAVLink_file_transfer_protocol_message(0, 1, 1, list(payload))


def item(current):
    return mav.MAVLink_mission_item_int_message(1, 1, 0, 6, 16, current, 1, 0, 0, 0, 0, 0, 0, 10, 0)


@pytest.mark.parametrize(
    ("message", "need"),
    [
        (mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), RequiredPermission.NOBODY_HEARS),
        (mav.MAVLink_request_data_stream_message(1, 1, 0, 4, 1), RequiredPermission.NOBODY_HEARS),
        (mav.MAVLink_param_request_list_message(1, 1), RequiredPermission.ANYBODY),
        (mav.MAVLink_param_request_read_message(1, 1, b"RTL_ALT", -1), RequiredPermission.ANYBODY),
        (mav.MAVLink_mission_request_list_message(1, 1, 0), RequiredPermission.ANYBODY),
        (file_message(4), RequiredPermission.ANYBODY),
        (requested(512, 148), RequiredPermission.ANYBODY),
        (requested(511, 32, 250_000), RequiredPermission.ANYBODY),
        (requested(511, 32, 50_000), RequiredPermission.NOBODY),  # too fast
        (requested(511, 32, -1), RequiredPermission.NOBODY),  # switches it off for all
        (requested(511, 30, 250_000), RequiredPermission.NOBODY),  # ATTITUDE: this edge flies by it
        (requested(511, NAN, 250_000), RequiredPermission.NOBODY),
        (mav.MAVLink_param_set_message(1, 1, b"RTL_ALT", 5.0, 9), RequiredPermission.OPERATOR),
        (mav.MAVLink_mission_count_message(1, 1, 4, FENCE), RequiredPermission.OPERATOR),
        (mav.MAVLink_mission_clear_all_message(1, 1, FENCE), RequiredPermission.OPERATOR),
        (file_message(6), RequiredPermission.OPERATOR),
        (requested(2000, 0, 0, 1), RequiredPermission.OPERATOR),  # a picture moves nothing
        (
            mav.MAVLink_mission_count_message(1, 1, 4, 0),
            RequiredPermission.TAKES_OVER,
        ),  # of what it may be flying
        (mav.MAVLink_mission_clear_all_message(1, 1, 0), RequiredPermission.TAKES_OVER),
        (item(0), RequiredPermission.TAKES_OVER),
        (item(2), RequiredPermission.TAKES_OVER),  # a place to fly to at once
        (requested(MavCmd.COMPONENT_ARM_DISARM, 1), RequiredPermission.TAKES_OVER),
        (requested(MavCmd.NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 10), RequiredPermission.TAKES_OVER),
        (requested(21), RequiredPermission.TAKES_OVER),
        (
            requested(60_000),
            RequiredPermission.TAKES_OVER,
        ),  # what nobody knows moves it for all that is known
        (mav.MAVLink_mission_set_current_message(1, 1, 0), RequiredPermission.TAKES_OVER),
        (mav.MAVLink_setup_signing_message(1, 1, [0] * 32, 0), RequiredPermission.NOBODY),
        (mav.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0), RequiredPermission.NOBODY),
        (mav.MAVLink_rc_channels_override_message(1, 1, *([1500] * 8)), RequiredPermission.NOBODY),
        (mav.MAVLink_gps_rtcm_data_message(0, 1, [0] * 180), RequiredPermission.NOBODY),
    ],
    ids=lambda value: value.get_type() if hasattr(value, "get_type") else value.name,
)
def test_who_may_send_what(message, need):
    assert required_permission(message, COPTER) is need


@pytest.mark.parametrize(
    ("stops", "message", "need"),
    [
        (COPTER, requested(MavCmd.DO_SET_MODE, 1, BRAKE), RequiredPermission.STOP),
        (
            COPTER,
            requested(MavCmd.DO_SET_MODE, 1, LOITER),
            RequiredPermission.TAKES_OVER,
        ),  # sinks without a remote control
        (COPTER, requested(MavCmd.DO_SET_MODE, 0, BRAKE), RequiredPermission.TAKES_OVER),
        (COPTER, requested(MavCmd.DO_PAUSE_CONTINUE, 0), RequiredPermission.STOP),
        (COPTER, requested(MavCmd.DO_PAUSE_CONTINUE, 1), RequiredPermission.TAKES_OVER),  # goes on
        (COPTER, mav.MAVLink_set_mode_message(1, 1, BRAKE), RequiredPermission.STOP),
        (COPTER, mav.MAVLink_set_mode_message(1, 1, LOITER), RequiredPermission.TAKES_OVER),
        (PX4, requested(MavCmd.DO_SET_MODE, 1, 4, 3), RequiredPermission.STOP),
        (PX4, requested(MavCmd.DO_SET_MODE, 1, 4, 5), RequiredPermission.TAKES_OVER),
        (PX4, requested(MavCmd.DO_REPOSITION, -1, 1, 0, NAN, NAN, NAN, NAN), RequiredPermission.STOP),
        (PX4, requested(MavCmd.DO_REPOSITION, -1, 1, 0, NAN, 47.4, 8.5, 500), RequiredPermission.TAKES_OVER),
        (
            PX4,
            requested(MavCmd.DO_REPOSITION, -1, 1, 0, 1.0, NAN, NAN, NAN),
            RequiredPermission.TAKES_OVER,
        ),  # turns it
        (
            PX4,
            mav.MAVLink_set_mode_message(1, 4, 0x03040000),
            RequiredPermission.TAKES_OVER,
        ),  # starts its mission
        (
            COPTER,
            mav.MAVLink_set_mode_message(1, 128, BRAKE),
            RequiredPermission.TAKES_OVER,
        ),  # the safety switch
        (
            COPTER,
            mav.MAVLink_set_mode_message(1, 1, BRAKE << 16 | 3),
            RequiredPermission.TAKES_OVER,
        ),  # AUTO, for ArduPilot
        (PX4, mav.MAVLink_set_mode_message(1, 1, 0x03040000), RequiredPermission.STOP),
        (PX4, requested(MavCmd.COMPONENT_ARM_DISARM, 0, 21196), RequiredPermission.TAKES_OVER),  # falls
        (PX4, requested(185, 1), RequiredPermission.TAKES_OVER),  # flight termination
        ([], requested(MavCmd.DO_SET_MODE, 1, BRAKE), RequiredPermission.TAKES_OVER),  # of an unknown vehicle
    ],
)
def test_a_stop_is_everybodys_and_nothing_else_is_one(stops, message, need):
    assert required_permission(message, stops) is need


PASSED = {
    RequiredPermission.ANYBODY,
    RequiredPermission.OPERATOR,
    RequiredPermission.TAKES_OVER,
    RequiredPermission.STOP,
}


def test_of_all_messages_there_are_only_these_are_passed_on(blank_message):
    passed = {
        kind.msgname
        for kind in mav.mavlink_map.values()
        if required_permission(blank_message(kind)) in PASSED
    }
    assert passed == {
        "COMMAND_INT",
        "COMMAND_LONG",
        "FILE_TRANSFER_PROTOCOL",
        "LOG_REQUEST_DATA",
        "LOG_REQUEST_END",
        "LOG_REQUEST_LIST",
        "MISSION_ACK",
        "MISSION_CLEAR_ALL",
        "MISSION_COUNT",
        "MISSION_ITEM",
        "MISSION_ITEM_INT",
        "MISSION_REQUEST",
        "MISSION_REQUEST_INT",
        "MISSION_REQUEST_LIST",
        "MISSION_REQUEST_PARTIAL_LIST",
        "MISSION_SET_CURRENT",
        "MISSION_WRITE_PARTIAL_LIST",
        "PARAM_EXT_REQUEST_LIST",
        "PARAM_EXT_REQUEST_READ",
        "PARAM_EXT_SET",
        "PARAM_REQUEST_LIST",
        "PARAM_REQUEST_READ",
        "PARAM_SET",
        "SET_ATTITUDE_TARGET",
        "SET_MODE",
        "SET_POSITION_TARGET_GLOBAL_INT",
        "SET_POSITION_TARGET_LOCAL_NED",
    }


@given(st.integers(0, 0xFFFF), st.lists(st.floats(width=32), min_size=7, max_size=7))
def test_no_numbers_of_a_command_break_the_rules(command, params):
    message = requested(command, *params)
    need = required_permission(message, [*COPTER, *PX4])
    if need in {RequiredPermission.STOP, RequiredPermission.ANYBODY}:
        assert command in {176, 192, 193, 410, 510, 511, 512, 519, 520, 521, 522, 525, 527, 2504, 2505}
