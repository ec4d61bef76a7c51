"""Permissions of a ground station beside the edge, by message. Pure.

Messages are pymavlink's, decoded. Messages in no table are never passed on.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable
from typing import Any

from fleet_mavlink.codec import is_read
from fleet_mavlink.constants import CUSTOM_MODE, MavCmd
from fleet_mavlink.messages import CommandLong

_FASTEST = 200_000.0  # us, shortest interval between messages that a station may request by itself
_HERE = -1.0  # speed of DO_REPOSITION: the autopilot's default


class RequiredPermission(enum.Enum):
    """Permission that a message needs."""

    NOBODY_HEARS = "it is the station's own"  # handled by the edge, neither passed on nor refused
    ANYBODY = "reads"
    STOP = "stops the vehicle"
    OPERATOR = "changes something"
    TAKES_OVER = "moves the vehicle"  # for an operator, who has then taken the vehicle over
    NOBODY = "nobody may"


_OWN = frozenset({"HEARTBEAT", "PING", "REQUEST_DATA_STREAM", "SYSTEM_TIME", "TIMESYNC"})
"""Messages that are handled by the edge.

Heartbeats are never passed on: an autopilot that received them would not detect the loss of this edge. Nor is
REQUEST_DATA_STREAM: ArduPilot would change the rates that this edge needs.
"""
_READS = frozenset(
    {
        "MISSION_ACK",
        "MISSION_REQUEST",
        "MISSION_REQUEST_INT",
        "MISSION_REQUEST_LIST",
        "MISSION_REQUEST_PARTIAL_LIST",
        "PARAM_EXT_REQUEST_LIST",
        "PARAM_EXT_REQUEST_READ",
        "PARAM_REQUEST_LIST",
        "PARAM_REQUEST_READ",
    }
)
_CHANGES = frozenset(
    {
        "LOG_REQUEST_DATA",
        "LOG_REQUEST_END",
        "LOG_REQUEST_LIST",
        "PARAM_EXT_SET",
        "PARAM_SET",
    }
)
_MOVES = frozenset(
    {
        "MISSION_SET_CURRENT",
        "SET_ATTITUDE_TARGET",
        "SET_POSITION_TARGET_GLOBAL_INT",
        "SET_POSITION_TARGET_LOCAL_NED",
    }
)
_ITEMS = frozenset({"MISSION_ITEM", "MISSION_ITEM_INT"})
_PLANS = _ITEMS | {"MISSION_CLEAR_ALL", "MISSION_COUNT", "MISSION_WRITE_PARTIAL_LIST"}
"""For a mission (``mission_type`` 0) they move a vehicle that flies it; fences only limit it."""
_GUIDED_ITEM = 2  # ``current`` of a mission item that is a position to fly to at once
_READ_COMMANDS = frozenset({410, 510, 512, 519, 520, 521, 522, 525, 527, 2504, 2505})
_UNMOVING_COMMANDS = frozenset({*range(200, 207), 1000, 1001, *range(2000, 2600)})  # gimbal and camera
_READ_FILES = frozenset({1, 2, 3, 4, 5, 14, 15})  # opcodes of MAVLink FTP that change no file
_NAV_LAND = 21
_FTP_OPCODE = 3  # offset in the payload


def required_permission(message: Any, stops: Iterable[CommandLong] = ()) -> RequiredPermission:
    """Return the permission for a message; ``stops``: commands that brake and hold this vehicle."""
    name = message.get_type()
    if name in {"COMMAND_LONG", "COMMAND_INT"}:
        return _need_of_command(message, stops)
    if name == "SET_MODE":
        return _need_of_mode(message, stops)
    if name == "FILE_TRANSFER_PROTOCOL":
        return (
            RequiredPermission.ANYBODY
            if message.payload[_FTP_OPCODE] in _READ_FILES
            else RequiredPermission.OPERATOR
        )
    if name in _PLANS:
        guided = name in _ITEMS and message.current == _GUIDED_ITEM
        return (
            RequiredPermission.TAKES_OVER
            if guided or not getattr(message, "mission_type", 0)
            else RequiredPermission.OPERATOR
        )
    for names, need in _TABLES:
        if name in names:
            return need
    return RequiredPermission.NOBODY


_TABLES = (
    (_OWN, RequiredPermission.NOBODY_HEARS),
    (_READS, RequiredPermission.ANYBODY),
    (_CHANGES, RequiredPermission.OPERATOR),
    (_MOVES, RequiredPermission.TAKES_OVER),
)


def _need_of_command(message: Any, stops: Iterable[CommandLong]) -> RequiredPermission:
    """Return the permission for a COMMAND_LONG or COMMAND_INT."""
    command = message.command
    if command in _READ_COMMANDS:
        return RequiredPermission.ANYBODY
    if command == MavCmd.SET_MESSAGE_INTERVAL:
        return RequiredPermission.NOBODY if why_not_at_this_rate(message) else RequiredPermission.ANYBODY
    if _is_stop(message, stops):
        return RequiredPermission.STOP
    return RequiredPermission.OPERATOR if command in _UNMOVING_COMMANDS else RequiredPermission.TAKES_OVER


def why_not_at_this_rate(message: Any) -> str:
    """Return why SET_MESSAGE_INTERVAL is refused for a message, empty if it is permitted."""
    if not math.isfinite(message.param1) or is_read(int(message.param1)):
        return "this edge has set the rate of that message"
    if not message.param2 >= _FASTEST:
        return "5 Hz at most, and no message is switched off"
    return ""


def _is_stop(message: Any, stops: Iterable[CommandLong]) -> bool:
    """Return True if a command brakes and holds the vehicle where it is, and does nothing else."""
    if message.command == MavCmd.DO_PAUSE_CONTINUE:
        return bool(message.param1 == 0.0)
    if message.get_type() == "COMMAND_LONG" and message.command == MavCmd.DO_REPOSITION:
        place = (message.param4, message.param5, message.param6, message.param7)  # this form pauses PX4
        return message.param1 == _HERE and all(math.isnan(each) for each in place)
    return _is_among(message, stops)


def comes_down(message: Any, descents: Iterable[CommandLong]) -> bool:
    """Return True if a message lands the vehicle or sends it home, by a command or by one of these modes."""
    if message.get_type() not in {"COMMAND_LONG", "COMMAND_INT"}:
        return False
    return message.command in {MavCmd.NAV_RETURN_TO_LAUNCH, _NAV_LAND} or _is_among(message, descents)


def arms(message: Any) -> bool:
    """Return True if a message arms the vehicle."""
    is_command = message.get_type() in {"COMMAND_LONG", "COMMAND_INT"}
    return bool(is_command and message.command == MavCmd.COMPONENT_ARM_DISARM and message.param1 == 1.0)


def _is_among(message: Any, commands: Iterable[CommandLong]) -> bool:
    """Return True if a COMMAND_LONG is one of these commands."""
    given = (message.command, message.param1, message.param2, message.param3)
    among = {(each.command, each.param1, each.param2, each.param3) for each in commands}
    return message.get_type() == "COMMAND_LONG" and given in among


def _need_of_mode(message: Any, stops: Iterable[CommandLong]) -> RequiredPermission:
    """Return the permission for SET_MODE, whose mode is the number in a heartbeat.

    Without the flag of a custom mode the number has another meaning: ArduPilot's safety switch, or a base
    mode.
    """
    numbers = {_mode_number(stop) for stop in stops if stop.command == MavCmd.DO_SET_MODE}
    is_stop = bool(message.base_mode & int(CUSTOM_MODE)) and message.custom_mode in numbers
    return RequiredPermission.STOP if is_stop else RequiredPermission.TAKES_OVER


def _mode_number(change: CommandLong) -> int:
    """Return the heartbeat's mode number for a DO_SET_MODE; PX4's has two parts."""
    return int(change.param2) << 16 | int(change.param3) << 24 if change.param3 else int(change.param2)
