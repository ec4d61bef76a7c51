"""A command from the wire, in one form for COMMAND_LONG and COMMAND_INT."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import all as mav

ACCEPTED = int(mav.MAV_RESULT_ACCEPTED)
TEMPORARILY_REJECTED = int(mav.MAV_RESULT_TEMPORARILY_REJECTED)
DENIED = int(mav.MAV_RESULT_DENIED)
UNSUPPORTED = int(mav.MAV_RESULT_UNSUPPORTED)
FAILED = int(mav.MAV_RESULT_FAILED)
IN_PROGRESS = int(mav.MAV_RESULT_IN_PROGRESS)
_UNKNOWN_INT = 0x7FFFFFFF  # NaN in x and y of a COMMAND_INT


@dataclass(frozen=True, slots=True)
class CommandRequest:
    """One command and its sender; latitude and longitude are degrees, NaN if left out.

    ``frame`` is None for COMMAND_LONG, which has none.
    """

    command: int
    p1: float
    p2: float
    p3: float
    p4: float
    latitude: float
    longitude: float
    altitude: float
    frame: int | None
    system: int
    component: int


def decode_request(message: Any) -> CommandRequest:
    """Return the command in a COMMAND_LONG or COMMAND_INT."""
    frame: int | None = None
    latitude, longitude, altitude = 0.0, 0.0, 0.0
    if message.get_type() == "COMMAND_INT":
        frame = message.frame
        latitude, longitude = _degrees(message.x), _degrees(message.y)
        altitude = message.z
    else:
        latitude, longitude, altitude = message.param5, message.param6, message.param7
    return CommandRequest(
        message.command,
        message.param1,
        message.param2,
        message.param3,
        message.param4,
        latitude,
        longitude,
        altitude,
        frame,
        message.get_srcSystem(),
        message.get_srcComponent(),
    )


def _degrees(scaled: int) -> float:
    """Return degrees from 1e-7 degrees."""
    return math.nan if scaled == _UNKNOWN_INT else scaled / 1e7


def whole(number: float) -> int:
    """Return a parameter as an integer; -1 for NaN and infinity."""
    return int(number) if math.isfinite(number) else -1


def ack(request: CommandRequest, result: int, progress: int = 0) -> object:
    """Return the COMMAND_ACK addressed to the sender."""
    return mav.MAVLink_command_ack_message(
        request.command, result, progress, 0, request.system, request.component
    )
