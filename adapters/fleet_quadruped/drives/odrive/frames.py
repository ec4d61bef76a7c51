"""ODrive CAN Simple, firmware 0.6: node id and command in the identifier, little-endian values.

Source: docs.odriverobotics.com, "CAN Protocol". A remote frame requests the value of its identifier.
"""

from __future__ import annotations

import enum
import math
import struct
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from fleet import CanFrame

HIGHEST_NODE = 0x3E  # 3Fh is the address of drives without one
OLDEST = (0, 6)  # firmware; older ones have other errors, no temperature and no parameters over CAN
TURN = math.tau
MOST_TURNS = 10_000.0  # beyond them a float32 cannot resolve a milliradian
_SHIFT, _COMMAND = 5, 0x1F
_MILLI = 0.001
_WORD = 0x7FFF


class OdriveCommand(enum.IntEnum):
    """Commands in use, by number."""

    VERSION = 0x00
    HEARTBEAT = 0x01
    PARAMETER = 0x04  # RxSdo: reads or writes a parameter
    TX_SDO = 0x05  # TxSdo: the parameter that was read
    ADDRESS = 0x06
    STATE = 0x07
    ESTIMATES = 0x09
    MODES = 0x0B
    INPUT_POS = 0x0C
    TEMPERATURE = 0x15
    SUPPLY = 0x17
    CLEAR = 0x18
    POS_GAIN = 0x1A
    VEL_GAINS = 0x1B
    TORQUES = 0x1C


class State(enum.IntEnum):
    """States of an axis that we request; in all others it moves the motor by itself."""

    UNDEFINED = 0
    IDLE = 1
    CLOSED_LOOP = 8


POSITION_CONTROL, PASSTHROUGH = 3, 1  # parameters of the command MODES
WATCHDOG_EXPIRED = 1 << 24
ERRORS: Mapping[int, str] = MappingProxyType(
    {
        1 << 0: "initializing",
        1 << 1: "system level",
        1 << 2: "timing error",
        1 << 3: "missing estimate",
        1 << 4: "bad config",
        1 << 5: "gate driver fault",
        1 << 6: "missing input",
        1 << 8: "over-voltage",
        1 << 9: "under-voltage",
        1 << 10: "over-current",
        1 << 11: "regenerates too much current",
        1 << 12: "current limit violation",
        1 << 13: "motor over temperature",
        1 << 14: "inverter over temperature",
        1 << 15: "velocity limit violation",
        1 << 16: "position limit violation",
        WATCHDOG_EXPIRED: "our frames did not reach the drive",
        1 << 25: "emergency stop requested",
        1 << 26: "spinout detected",
        1 << 27: "brake resistor disarmed",
        1 << 28: "thermistor disconnected",
        1 << 30: "calibration error",
    }
)
"""Meaning of the bits of an axis's active errors."""

_VERSION = struct.Struct("<8B")
_HEARTBEAT = struct.Struct("<IBBBx")
_PAIR = struct.Struct("<ff")
_INPUT = struct.Struct("<fhh")
_TWO = struct.Struct("<II")
_PARAMETER = struct.Struct("<BHx")  # operation, endpoint
_READ, _WRITE = 0, 1


class OdriveHeartbeat(NamedTuple):
    """Active errors, and state of the axis."""

    errors: int
    state: int


def identifier(node: int, command: OdriveCommand) -> int:
    """Return the identifier for a command of a node."""
    return node << _SHIFT | command


def split(number: int) -> tuple[int, int]:
    """Return node id and command of an identifier."""
    return number >> _SHIFT, number & _COMMAND


def request(node: int, command: OdriveCommand) -> CanFrame:
    """Return the remote frame that requests the value of a command."""
    return CanFrame(identifier(node, command), b"", remote=True)


def words(errors: int) -> str:
    """Return the meaning of active errors; the number of unknown ones."""
    known = [text for bit, text in ERRORS.items() if errors & bit]
    rest = errors & ~sum(ERRORS)
    return ", ".join([*known, *([f"error {rest:X}h"] if rest else [])])


def pack_heartbeat(errors: int, state: int) -> bytes:
    """Return a heartbeat (drive side)."""
    return _HEARTBEAT.pack(errors, state, 0, 0)


def unpack_heartbeat(data: bytes) -> OdriveHeartbeat | None:
    """Decode a heartbeat; None if it is too short."""
    if len(data) < _HEARTBEAT.size:
        return None
    errors, state, _result, _done = _HEARTBEAT.unpack_from(data)
    return OdriveHeartbeat(errors, state)


def pack_version(major: int, minor: int) -> bytes:
    """Return protocol, hardware and firmware version (drive side)."""
    return _VERSION.pack(2, 4, 4, 58, major, minor, 10, 0)


def unpack_version(data: bytes) -> tuple[int, int] | None:
    """Return the firmware version; None if the frame is too short."""
    return (data[4], data[5]) if len(data) >= _VERSION.size else None


def pack_pair(first: float, second: float) -> bytes:
    """Encode two numbers: estimates (turns, turn/s), gains, temperatures (deg C), supply (V, A), torques."""
    return _PAIR.pack(first, second)


def unpack_pair(data: bytes) -> tuple[float, float] | None:
    """Decode two numbers; None if the frame is too short or one is not finite."""
    if len(data) < _PAIR.size:
        return None
    first, second = _PAIR.unpack_from(data)
    return (first, second) if math.isfinite(first) and math.isfinite(second) else None


def warmest(data: bytes) -> float | None:
    """Return the higher temperature of transistors and motor, deg C; a missing sensor reports NaN."""
    if len(data) < _PAIR.size:
        return None
    return max(filter(math.isfinite, _PAIR.unpack_from(data)), default=None)


def pack_input(angle: float, speed: float, torque: float) -> bytes:
    """Encode a position (rad) with feed-forward speed (rad/s) and torque (N m), which are clamped.

    Raises ValueError for NaN and infinity.
    """
    turns = finite(angle) / TURN
    return _INPUT.pack(turns, _thousandths(speed / TURN), _thousandths(torque))


def unpack_input(data: bytes) -> tuple[float, float, float] | None:
    """Return rad, rad/s and N m of a position command; None if it is too short or not finite."""
    if len(data) < _INPUT.size:
        return None
    turns, speed, torque = _INPUT.unpack_from(data)
    if not math.isfinite(turns):
        return None
    return turns * TURN, speed * _MILLI * TURN, torque * _MILLI


def pack_gain(value: float) -> bytes:
    """Encode one number."""
    return struct.pack("<f", finite(value))


def pack_state(state: State) -> bytes:
    """Encode a requested state."""
    return struct.pack("<I", state)


def pack_modes() -> bytes:
    """Encode position control with the input passed through."""
    return _TWO.pack(POSITION_CONTROL, PASSTHROUGH)


def gains(kp: float, kd: float) -> tuple[float, float]:
    """Return position gain (1/s) and velocity gain (N m s/turn) for stiffness (N m/rad) and damping.

    torque = velocity gain x (position gain x error + feed-forward speed - speed): a spring and a damper.
    """
    return (kp / kd if kd else 0.0), kd * TURN


def read_parameter(endpoint: int) -> bytes:
    """Encode the request for a parameter."""
    return _PARAMETER.pack(_READ, endpoint)


def write_parameter(endpoint: int, value: bytes) -> bytes:
    """Encode a write of a parameter, valid until power-off; it is not acknowledged."""
    return _PARAMETER.pack(_WRITE, endpoint) + value


def unpack_parameter(data: bytes) -> tuple[int, int, bytes] | None:
    """Return operation (1: write), endpoint and value; None if the frame is too short."""
    if len(data) < _PARAMETER.size:
        return None
    operation, endpoint = _PARAMETER.unpack_from(data)
    return operation, endpoint, data[_PARAMETER.size :]


def _thousandths(value: float) -> int:
    """Return a number in thousandths as a 16-bit word, clamped, never wrapped."""
    return max(-_WORD, min(_WORD, round(max(-1e6, min(1e6, finite(value))) / _MILLI)))


def finite(value: float) -> float:
    """Return the number; raises ValueError for NaN and infinity."""
    if not math.isfinite(value):
        raise ValueError(f"cannot send {value} to a motor")
    return value
