"""The MIT frame: position 16 bit, speed, kp, kd, torque 12 bit each, big-endian, linear over their ranges."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from fleet_quadruped.drives.mit.profiles import Profile

ENABLE = b"\xff\xff\xff\xff\xff\xff\xff\xfc"
DISABLE = b"\xff\xff\xff\xff\xff\xff\xff\xfd"
CLEAR = b"\xff\xff\xff\xff\xff\xff\xff\xfb"  # Damiao only
SPECIAL = frozenset({ENABLE, DISABLE, CLEAR})
MASTER = 0x10  # + motor id: where a Damiao motor answers
REGISTERS = 0x7FF
READ, WRITE = 0x33, 0x55
TIMEOUT_REGISTER = 9  # in units of 50 us; 0: no watchdog
MASTER_REGISTER = 7
RANGE_REGISTERS = (21, 22, 23)  # float32: angle, speed, torque
_TICK = 50e-6
_FULL = (1 << 64) - 1

STATUS: Mapping[int, str] = MappingProxyType(
    {
        0x5: "sensor",
        0x6: "parameter",
        0x8: "over-voltage",
        0x9: "under-voltage",
        0xA: "over-current",
        0xB: "MOSFETs too hot",
        0xC: "rotor too hot",
        0xD: "our frames did not reach the motor",
        0xE: "overload",
    }
)
DISABLED, ENABLED = 0x0, 0x1


class MitCommand(NamedTuple):
    """What one motor is to do: rad, rad/s, N m/rad, N m s/rad, N m."""

    angle: float = 0.0
    speed: float = 0.0
    kp: float = 0.0
    kd: float = 0.0
    torque: float = 0.0


class MitReply(NamedTuple):
    """What a motor tells; ``status`` is a Damiao motor's nibble, or an error byte, None without one."""

    motor: int
    angle: float
    speed: float
    torque: float
    status: int | None
    temperature: float | None


class _Field(NamedTuple):
    """A number in a frame: its range, how many steps one unit has, and how many bits it takes."""

    low: float
    high: float
    steps: float
    bits: int


class Layout:
    """The frames of one kind of motor, both sides; made once, because each cycle packs dozens of numbers."""

    def __init__(self, profile: Profile) -> None:
        angle = _field(-profile.angle, profile.angle, 16)
        speed = _field(-profile.speed, profile.speed)
        torque = _field(-profile.torque, profile.torque)
        self._command = (angle, speed, _field(0.0, profile.kp), _field(0.0, profile.kd), torque)
        self._reply = (angle, speed, torque)
        self._profile = profile

    def pack_command(self, command: MitCommand) -> bytes:
        """Return a command's eight bytes: clamped, and never all ones (those are special frames)."""
        whole = _pack(command, self._command)
        if whole >> 8 == _FULL >> 8:
            whole -= 1 << 12  # one step less of kd: not one of the special frames
        return whole.to_bytes(8, "big")

    def unpack_command(self, data: bytes) -> MitCommand | None:
        """Return what a command says (the motor's side); None for one of another length."""
        if len(data) != 8:
            return None
        return MitCommand(*_unpack(int.from_bytes(data, "big"), self._command))

    def pack_reply(self, reply: MitReply) -> bytes:
        """Return a reply (the motor's side)."""
        profile = self._profile
        first = (reply.status or 0) << 4 | reply.motor & 0xF if profile.damiao else reply.motor
        whole = first << 40 | _pack((reply.angle, reply.speed, reply.torque), self._reply)
        data = bytearray(whole.to_bytes(6, "big"))
        if profile.damiao or profile.temperature_at is not None:
            data += bytes(2)
            data[profile.temperature_at or 7] = max(0, min(255, round(reply.temperature or 0)))
        if profile.error_at is not None:
            data[profile.error_at] = reply.status or 0
        return bytes(data)

    def unpack_reply(self, data: bytes) -> MitReply | None:
        """Return what a reply says; None when it is too short."""
        if len(data) < 6:
            return None
        profile, first = self._profile, data[0]
        status: int | None = first >> 4 if profile.damiao else None
        if profile.error_at is not None and len(data) > profile.error_at:
            status = data[profile.error_at]
        at = profile.temperature_at
        angle, speed, torque = _unpack(int.from_bytes(data[1:6], "big"), self._reply)
        return MitReply(
            first & 0xF if profile.damiao else first,
            angle,
            speed,
            torque,
            status,
            float(data[at]) if at is not None and len(data) > at else None,
        )


def read_register(motor: int, register: int) -> bytes:
    """Return the question for a Damiao register; it goes to ``REGISTERS``."""
    return struct.pack("<HBB4x", motor, READ, register)


def write_register(motor: int, register: int, value: bytes) -> bytes:
    """Return what writes four bytes into a Damiao register (kept until power-off)."""
    return struct.pack("<HBB4s", motor, WRITE, register, value)


def unpack_register(data: bytes) -> tuple[int, int, bytes] | None:
    """Return (motor, register, four bytes) of an answer; None for a frame that is something else."""
    if len(data) != 8 or data[2] not in {READ, WRITE}:
        return None
    motor, _, register, value = struct.unpack("<HBB4s", data)
    return motor, register, value


def timeout_value(seconds: float) -> bytes:
    """Return the watchdog's register for a time."""
    return struct.pack("<I", max(1, round(seconds / _TICK)))


def _field(low: float, high: float, bits: int = 12) -> _Field:
    return _Field(low, high, ((1 << bits) - 1) / (high - low), bits)


def _pack(values: Sequence[float], fields: Sequence[_Field]) -> int:
    """Return numbers side by side, the first in the highest bits; what is no number is refused."""
    whole = 0
    for value, (low, high, steps, bits) in zip(values, fields, strict=True):
        if not low <= value <= high:
            if not math.isfinite(value):
                raise ValueError(f"a motor cannot be sent {value}")
            value = low if value < low else high  # noqa: PLW2901 - a clamped value is that value
        whole = whole << bits | round((value - low) * steps)
    return whole


def _unpack(whole: int, fields: Sequence[_Field]) -> list[float]:
    """Return the numbers that lie side by side in the lowest bits."""
    values: list[float] = []
    for low, _, steps, bits in reversed(fields):
        values.append(low + (whole & (1 << bits) - 1) / steps)
        whole >>= bits
    values.reverse()
    return values
