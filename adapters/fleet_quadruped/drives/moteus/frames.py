"""moteus register protocol on CAN FD: sub-frames that write and read registers, little-endian.

Source: mjbots.github.io/moteus, "CAN Protocol", "Register Reference", "Diagnostic Protocol". Angles are turns
of the output. NaN as a position is the present one; NaN as a limit is the configured one.
"""

from __future__ import annotations

import math
import struct
from bisect import bisect_left
from collections.abc import Mapping
from itertools import repeat
from types import MappingProxyType
from typing import NamedTuple

from fleet import STANDARD_ID

TURN = math.tau
MOST_TURNS = 10_000.0  # beyond them a float32 cannot resolve a milliradian
REPLY = 0x8000  # bit of the identifier of a frame to a servo: request an answer
_SOURCE = 8  # bits of the destination, below the source; our source is 0
_LENGTHS = (8, 12, 16, 20, 24, 32, 48, 64)  # of CAN FD frames, from 8 bytes on
_NOP = b"\x50"

MODE, POSITION, VELOCITY, TORQUE, HOME, VOLTAGE, TEMPERATURE, FAULT = 0, 1, 2, 3, 0xC, 0xD, 0xE, 0xF
COMMAND = 0x20  # position, velocity, torque, kp scale, kd scale, maximum torque, stop position, watchdog
STOPPED, FAILED, STARTING, OBEYS, TIMED_OUT, DAMPS, BRAKES = 0, 1, frozenset({2, 3, 4}), 10, 11, 12, 15
"""Modes, register 000h: only ``STOPPED`` leads out of ``TIMED_OUT``."""
REFERS_TO_NOTHING, REFERS_TO_ROTOR, REFERS_TO_OUTPUT = 0, 1, 2
"""Reference of a position, register 00Ch."""

FAULTS: Mapping[int, str] = MappingProxyType(
    {
        32: "calibration fault",
        33: "over-current, or its supply voltage dropped",
        34: "over-voltage",
        35: "encoder fault",
        36: "motor not calibrated",
        37: "cycle overrun",
        38: "over temperature",
        39: "outside servopos.position_min and position_max",
        40: "under-voltage",
        41: "configuration changed in motion",
        42: "no commutation encoder",
        43: "no output encoder",
        44: "gate driver not enabled",
        46: "timing violation",
        48: "position limits beyond what it can measure",
    }
)
"""Fault codes, register 00Fh, in mode 1."""

_WRITE_MODE = b"\x01\x00"
_WRITE_COMMAND = struct.Struct("<3B8f")
_COMMAND_HEAD = 0x0C, 8, COMMAND
_NO_LIMITS = b"\x02\x28\xff\xff"  # velocity and acceleration, negative: no limit
QUERY = b"\x1c\x04\x00\x14\x04\x0c"
"""Reads mode to torque as floats, and position reference to fault as int16."""
_LAYOUTS = tuple(tuple(struct.Struct(f"<{count}{kind}") for count in range(_LENGTHS[-1])) for kind in "bhif")
"""Layouts of numbers in a frame, by resolution and count."""
_SCALES: tuple[Mapping[int, float], ...] = (
    MappingProxyType({POSITION: 0.01, VELOCITY: 0.1, TORQUE: 0.5, VOLTAGE: 0.5}),
    MappingProxyType({POSITION: 0.0001, VELOCITY: 0.00025, TORQUE: 0.01, VOLTAGE: 0.1, TEMPERATURE: 0.1}),
    MappingProxyType(
        {POSITION: 0.00001, VELOCITY: 0.00001, TORQUE: 0.001, VOLTAGE: 0.001, TEMPERATURE: 0.001}
    ),
    MappingProxyType({}),
)
"""Units of registers, if they are not 1, by resolution."""
_QUERIED = (MODE, POSITION, VELOCITY, TORQUE, HOME, VOLTAGE, TEMPERATURE, FAULT)
_INT16, _FLOAT = 1, 3  # resolutions
_CHANNEL = 1  # diagnostic channel
_LONGEST = 40  # bytes of text in a frame


class ServoCommand(NamedTuple):
    """Command of a servo: turns, turn/s, N m, shares of its gains, N m, s."""

    position: float
    velocity: float
    torque: float
    kp_scale: float
    kd_scale: float
    most: float
    watchdog: float


class Subframe(NamedTuple):
    """One sub-frame: kind (high four bits), first register or channel, number of them, values or text."""

    kind: int
    start: int
    values: tuple[float, ...] = ()
    size: int = 0
    resolution: int = 3
    text: bytes = b""


def to_servo(number: int) -> int:
    """Return the identifier of a frame to a servo that requests an answer."""
    return REPLY | number


def from_servo(number: int) -> int:
    """Return the identifier of its answers."""
    return number << _SOURCE


def heard_by(number: int) -> tuple[int, ...]:
    """Return the identifiers that a servo accepts: all whose low byte is its id."""
    return (*range(number, STANDARD_ID, 1 << _SOURCE), to_servo(number))


def pack_mode(mode: int) -> bytes:
    """Return a frame that only sets a mode, with a query."""
    return _padded(_WRITE_MODE + bytes([mode]) + QUERY)


def pack_demand(mode: int, demand: ServoCommand) -> bytes:
    """Return a frame that sets a mode and its parameters, with a query.

    The position may be NaN: the present one. Raises ValueError for any other NaN and for infinity.
    """
    position, *others = demand
    for value in others:
        if not math.isfinite(value):
            raise ValueError(f"cannot send {value} to a motor")
    if math.isinf(position):
        raise ValueError(f"cannot send {position} to a motor")
    *first, watchdog = others
    numbers = _WRITE_COMMAND.pack(*_COMMAND_HEAD, position, *first, math.nan, watchdog)
    return _padded(_WRITE_MODE + bytes([mode]) + numbers + _NO_LIMITS + QUERY)


def pack_query() -> bytes:
    """Return a frame with a query only."""
    return _padded(QUERY)


def pack_text(line: str) -> bytes:
    """Return a line for the servo's diagnostics with a poll for its answer; empty: the poll only."""
    data = line.encode("ascii")
    written = bytes([0x40, _CHANNEL, len(data)]) + data if data else b""
    return _padded(written + bytes([0x42, _CHANNEL, _LONGEST]))


def pack_answer(text: bytes) -> bytes:
    """Return text of the diagnostics (servo side)."""
    return _padded(bytes([0x41, _CHANNEL, len(text)]) + text)


def pack_reply(resolution: int, start: int, values: tuple[float, ...]) -> bytes:
    """Return registers (servo side), not padded; integers are clamped, never wrapped."""
    if resolution < _FLOAT:
        most, scales = (1 << (8 << resolution) - 1) - 1, _SCALES[resolution]
        scaled = [value / scales.get(register, 1.0) for register, value in enumerate(values, start)]
        values = tuple([max(-most, min(most, round(value))) for value in scaled])
    count = len(values)
    return bytes((0x20 | resolution << 2, count, start)) + _LAYOUTS[resolution][count].pack(*values)


def padded(data: bytes) -> bytes:
    """Return data padded to a length that CAN FD has."""
    return _padded(data)


def unpack(data: bytes) -> list[Subframe] | None:
    """Return the sub-frames of a frame; None if it is cut short or has an unknown one."""
    try:
        return _parts(data)
    except (IndexError, struct.error, ValueError):
        return None


def reply(parts: list[Subframe]) -> dict[int, float] | None:
    """Return the registers of an answer to ``QUERY``, all finite; None for an answer to another query.

    Other host tools have the same source by default, so a servo's answers to them have the same identifier.
    They may lack registers, or have them as integers: coarse, and clamped.
    """
    written = registers([part for part in parts if part.kind == 2 and _has_our_type(part)])
    return written if all(map(math.isfinite, map(written.get, _QUERIED, repeat(math.nan)))) else None


def _has_our_type(part: Subframe) -> bool:
    """Return whether the numbers of a sub-frame have the type of an answer to ``QUERY``."""
    return part.resolution == _FLOAT or (part.resolution == _INT16 and part.start >= HOME)


def registers(parts: list[Subframe]) -> dict[int, float]:
    """Return the registers of an answer, in their units."""
    found: dict[int, float] = {}
    for part in parts:
        if part.kind != 2:
            continue
        scales = _SCALES[part.resolution]
        for register, value in enumerate(part.values, part.start):
            found[register] = value * scales.get(register, 1.0)
    return found


def _parts(data: bytes) -> list[Subframe]:
    """Return sub-frames; raises IndexError, ValueError or struct.error for invalid data."""
    found, at, end = [], 0, len(data)
    while at < end:
        head = data[at]
        at += 1
        if head == _NOP[0]:
            continue
        kind = head >> 4
        if kind <= 2:
            count = head & 3
            if not count:
                count, at = _varuint(data, at)
            start, at = _varuint(data, at)
            resolution = head >> 2 & 3
            values: tuple[float, ...] = ()
            if kind != 1:
                layout = _LAYOUTS[resolution][count]
                values = layout.unpack_from(data, at)
                at += layout.size
            found.append(Subframe(kind, start, values, count, resolution))
        elif head in {0x30, 0x31}:
            start, at = _varuint(data, at)
            _, at = _varuint(data, at)
            found.append(Subframe(3, start))
        elif head in {0x40, 0x41, 0x42}:
            channel, at = _varuint(data, at)
            length, at = _varuint(data, at)
            text = b"" if head == 0x42 else data[at : at + length]
            if head != 0x42 and len(text) < length:
                raise ValueError("cut short")
            at += len(text)
            found.append(Subframe(head, channel, text=text))
        else:
            raise ValueError(f"sub-frame {head:02X}h")
    return found


def _varuint(data: bytes, at: int) -> tuple[int, int]:
    """Return a number of 7 bits per byte, and the index after it."""
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at += 1
        if byte < 0x80:
            return value, at
        shift += 7
        if shift > 28:
            raise ValueError("number too long")


def _padded(data: bytes) -> bytes:
    return data.ljust(_LENGTHS[bisect_left(_LENGTHS, len(data))], _NOP)
