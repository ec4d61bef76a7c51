"""MIT frames: position 16 bits; speed, kp, kd, torque 12 bits each; big-endian, linear over their ranges."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from fleet_quadruped.drives.mit.profiles import MotorProfile

ENABLE = b"\xff\xff\xff\xff\xff\xff\xff\xfc"
DISABLE = b"\xff\xff\xff\xff\xff\xff\xff\xfd"
CLEAR = b"\xff\xff\xff\xff\xff\xff\xff\xfb"  # Damiao only
SPECIAL = frozenset({ENABLE, DISABLE, CLEAR})
MASTER = 0x10  # + motor id: reply identifier of a Damiao motor
REGISTERS = 0x7FF
READ, WRITE = 0x33, 0x55
_REGISTER_KINDS = frozenset({READ, WRITE})
TIMEOUT_REGISTER = 9  # in units of 50 us; 0: no watchdog
MASTER_REGISTER = 7
RANGE_REGISTERS = (21, 22, 23)  # float32: angle, speed, torque
_TICK = 50e-6
_COMMAND = struct.Struct(">4H")  # 16 bits of angle, then four numbers of 12 bits
_REPLY = struct.Struct(">B2HB")  # motor id, 16 bits of angle, two numbers of 12 bits
_WHOLE_REPLY = struct.Struct(">B2H3B")  # and two more bytes: rotor temperature last, or temperature, error

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
    """Command of one motor: rad, rad/s, N m/rad, N m s/rad, N m."""

    angle: float = 0.0
    speed: float = 0.0
    kp: float = 0.0
    kd: float = 0.0
    torque: float = 0.0


MitSetpoint = tuple[float, float, float, float, float]
"""The numbers of a ``MitCommand``; a plain tuple, because each cycle creates dozens."""
MitFeedback = tuple[int, float, float, float, int | None, float | None]
"""A motor's reply: id, rad, rad/s, N m, status (a Damiao motor's nibble, or an error byte), deg C.

Status and temperature are None if the motor does not report them.
"""


class MitLayout:
    """Frames of one kind of motor, both sides; precomputed, because each cycle packs dozens of numbers."""

    def __init__(self, profile: MotorProfile) -> None:
        self._ranges = profile.angle, profile.speed, profile.torque
        self._angle = 0xFFFF / (2 * profile.angle)  # steps per rad; the others alike
        self._speed = 0xFFF / (2 * profile.speed)
        self._kp, self._kd = 0xFFF / profile.kp, 0xFFF / profile.kd
        self._torque = 0xFFF / (2 * profile.torque)
        self._profile = profile
        self._damiao = profile.damiao
        self._warm_at, self._error_at = profile.temperature_at, profile.error_at
        self._degrees = tuple(float(profile.coldest + step) for step in range(256))

    def pack_command(self, command: MitSetpoint) -> bytes:
        """Return the eight bytes of a command; see ``pack_target``."""
        angle, speed, kp, kd, torque = command
        return self.pack_target(angle, speed, torque, self.pack_gains(kp, kd))

    def pack_gains(self, kp: float, kd: float) -> int:
        """Return stiffness and damping as encoded in a command, clamped.

        Raises ValueError for NaN and infinity.
        """
        profile = self._profile
        kp, kd = _within(kp, 0.0, profile.kp), _within(kd, 0.0, profile.kd)
        return round(kp * self._kp) << 12 | round(kd * self._kd)

    def pack_target(self, angle: float, speed: float, torque: float, gains: int) -> bytes:
        """Return the eight bytes of a command: clamped, and never all ones (those are special frames).

        ``gains`` are from ``pack_gains``. Raises ValueError for NaN and infinity.
        """
        moved, turning, pushed = self._raw(angle, speed, torque)
        second, third = turning << 4 | gains >> 20, gains >> 4 & 0xFFFF
        if moved & second & third == 0xFFFF and gains & 0xF == 0xF and pushed >> 8 == 0xF:
            gains -= 1  # one step less kd: not a special frame
        return _COMMAND.pack(moved, second, third, (gains & 0xF) << 12 | pushed)

    def unpack_command(self, data: bytes) -> MitSetpoint | None:
        """Decode a command (motor side); None for another length."""
        if len(data) != 8:
            return None
        angle, speed, torque = self._ranges
        moved, second, third, last = _COMMAND.unpack(data)
        return (
            moved / self._angle - angle,
            (second >> 4) / self._speed - speed,
            ((second & 0xF) << 8 | third >> 8) / self._kp,
            ((third & 0xFF) << 4 | last >> 12) / self._kd,
            (last & 0xFFF) / self._torque - torque,
        )

    def pack_reply(self, reply: MitFeedback) -> bytes:
        """Return a reply (motor side)."""
        number, angle, speed, torque, status, temperature = reply
        first = (status or 0) << 4 | number & 0xF if self._damiao else number
        moved, turning, pushed = self._raw(angle, speed, torque)
        second, last = turning << 4 | pushed >> 8, pushed & 0xFF
        if self._warm_at is None:
            return _REPLY.pack(first, moved, second, last)
        warm = round(temperature or 0) - self._profile.coldest
        warm = warm if 0 <= warm <= 0xFF else 0xFF * (warm > 0)
        if self._error_at is None:
            return _WHOLE_REPLY.pack(first, moved, second, last, 0, warm)
        return _WHOLE_REPLY.pack(first, moved, second, last, warm, status or 0)

    def unpack_reply(self, data: bytes) -> MitFeedback | None:
        """Decode a reply; None if it is too short."""
        size, warm_at, error_at = len(data), self._warm_at, self._error_at
        if size < 6:
            return None
        angle, speed, torque = self._ranges
        number, moved, second, last = _REPLY.unpack_from(data)
        status: int | None = None
        if self._damiao:
            number, status = number & 0xF, number >> 4
        elif error_at is not None and size > error_at:
            status = data[error_at]
        return (
            number,
            moved / self._angle - angle,
            (second >> 4) / self._speed - speed,
            ((second & 0xF) << 8 | last) / self._torque - torque,
            status,
            self._degrees[data[warm_at]] if warm_at is not None and size > warm_at else None,
        )

    def _raw(self, angle: float, speed: float, torque: float) -> tuple[int, int, int]:
        """Return angle, speed and torque as encoded in commands and replies, clamped."""
        most_angle, most_speed, most_torque = self._ranges
        if not (
            -most_angle <= angle <= most_angle
            and -most_speed <= speed <= most_speed
            and -most_torque <= torque <= most_torque
        ):
            angle = _within(angle, -most_angle, most_angle)
            speed = _within(speed, -most_speed, most_speed)
            torque = _within(torque, -most_torque, most_torque)
        return (
            round((angle + most_angle) * self._angle),
            round((speed + most_speed) * self._speed),
            round((torque + most_torque) * self._torque),
        )


def read_register(motor: int, register: int) -> bytes:
    """Return the request for a Damiao register; its identifier is ``REGISTERS``."""
    return struct.pack("<HBB4x", motor, READ, register)


def write_register(motor: int, register: int, value: bytes) -> bytes:
    """Return the request that writes four bytes into a Damiao register (kept until power-off)."""
    return struct.pack("<HBB4s", motor, WRITE, register, value)


def unpack_register(data: bytes) -> tuple[int, int, bytes] | None:
    """Return (motor, register, four bytes) of an answer; None for any other frame."""
    if len(data) != 8 or data[2] not in _REGISTER_KINDS:
        return None
    motor, _, register, value = struct.unpack("<HBB4s", data)
    return motor, register, value


def timeout_value(seconds: float) -> bytes:
    """Return the watchdog register for a time in s."""
    return struct.pack("<I", max(1, round(seconds / _TICK)))


def _within(value: float, low: float, high: float) -> float:
    """Clamp a number to its range in a frame; raises ValueError for NaN and infinity."""
    if not math.isfinite(value):
        raise ValueError(f"cannot send {value} to a motor")
    return max(low, min(high, value))
