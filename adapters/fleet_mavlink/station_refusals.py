"""Refusals of a ground station's messages, by the means of each protocol. Pure.

Messages are pymavlink's. A refusal is sent in the name of the addressed component.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import Any

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.constants import MavCmd, MavResult

_NAK, _PROTECTED = 129, 9  # opcode and error of MAVLink FTP
_FTP_HEAD = struct.Struct("<HBBBBBxI")  # sequence, session, opcode, size, requested opcode, burst, offset
_FTP_BYTES = 251
_TEXT = 50  # bytes in one STATUSTEXT
_WARNING = 4
_ID = 0x7FFF  # id of a text in chunks; autopilots count theirs from 1


def refusal(message: Any) -> Any | None:
    """Return the message that refuses another one, None if the protocol has none."""
    answer = _ANSWERS.get(message.get_type())
    return answer(message, message.get_srcSystem(), message.get_srcComponent()) if answer else None


def _no_command(message: Any, system: int, component: int) -> Any:
    return mav.MAVLink_command_ack_message(message.command, MavResult.DENIED, 0, 0, system, component)


def _no_mode(_message: Any, system: int, component: int) -> Any:
    return mav.MAVLink_command_ack_message(MavCmd.DO_SET_MODE, MavResult.DENIED, 0, 0, system, component)


def _no_mission(message: Any, system: int, component: int) -> Any:
    return mav.MAVLink_mission_ack_message(system, component, mav.MAV_MISSION_DENIED, message.mission_type)


def _no_parameter(message: Any, system: int, component: int) -> Any:
    name, denied = message.param_id.encode(), mav.MAV_PARAM_ERROR_PERMISSION_DENIED
    return mav.MAVLink_param_error_message(system, component, name, -1, denied)


def _no_long_parameter(message: Any, _system: int, _component: int) -> Any:
    name, value = message.param_id.encode(), message.param_value.encode()
    return mav.MAVLink_param_ext_ack_message(name, value, message.param_type, mav.PARAM_ACK_FAILED)


def _no_file(message: Any, system: int, component: int) -> Any:
    sequence, session, opcode, *_ = _FTP_HEAD.unpack_from(bytes(message.payload))
    head = _FTP_HEAD.pack((sequence + 1) & 0xFFFF, session, _NAK, 1, opcode, 0, 0)
    payload = (head + bytes([_PROTECTED])).ljust(_FTP_BYTES, b"\0")
    return mav.MAVLink_file_transfer_protocol_message(0, system, component, list(payload))


_ANSWERS: Mapping[str, Callable[[Any, int, int], Any]] = {
    "COMMAND_INT": _no_command,
    "COMMAND_LONG": _no_command,
    "FILE_TRANSFER_PROTOCOL": _no_file,
    "MISSION_CLEAR_ALL": _no_mission,
    "MISSION_COUNT": _no_mission,
    "MISSION_ITEM": _no_mission,
    "MISSION_ITEM_INT": _no_mission,
    "MISSION_WRITE_PARTIAL_LIST": _no_mission,
    "PARAM_EXT_SET": _no_long_parameter,
    "PARAM_SET": _no_parameter,
    "SET_MODE": _no_mode,
}


def unchanged(message: Any) -> Any | None:
    """Return the request that makes a refused parameter's value known again, None for other messages.

    Stations without PARAM_ERROR detect a refusal by the PARAM_VALUE that follows a PARAM_SET.
    """
    if message.get_type() != "PARAM_SET":
        return None
    place = (message.target_system, message.target_component)
    return mav.MAVLink_param_request_read_message(*place, message.param_id.encode(), -1)


def words(text: str) -> list[Any]:
    """Return a warning as STATUSTEXT, in chunks if it is too long for one."""
    data = text.encode()
    pieces = [data[at : at + _TEXT] for at in range(0, len(data), _TEXT)]
    number = _ID if len(pieces) > 1 else 0
    return [
        mav.MAVLink_statustext_message(_WARNING, piece, number, place) for place, piece in enumerate(pieces)
    ]
