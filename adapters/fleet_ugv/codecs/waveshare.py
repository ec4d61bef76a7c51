"""JSON lines of Waveshare's ESP32 boards (ugv_base_ros 0.96, ugv_base_general 0.95), 115200 baud.

Both send T 1001, with different fields: ``odl`` is in one, ``r`` in the other. Motion is always T 1, wheel
speeds, because it is the only command whose dead-man works in both. The firmware ignores a wheel speed beyond
2 m/s and keeps the previous one, so none is ever sent.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar

import msgspec

from fleet import Vector3
from fleet_ugv.codecs.base import LineCodec
from fleet_ugv.model import BaseFault, Confirmed, Feedback, Motion, UgvEvent, Wheels

FASTEST = 2.0  # m/s; the firmware ignores more
LONGEST_LINE = 1024  # bytes, more than the longest line of the board
PAN_TILT = 2  # the module number of T 900 for a camera mount
GIMBAL_STEPS = 600  # servo steps a second at which T 134 turns the mount
GIMBAL_SPEED = GIMBAL_STEPS * math.tau / 4096  # rad/s: a turn of its servos has 4096 steps
SHOWN = 60  # characters of a display line: the board drops commands of more than 256 bytes
GYRO = math.radians(1 / 16.4)  # rad/s of one step
ACCEL = 9.80665 / 8192  # m/s2 of one step
COMMANDS = frozenset({*range(-3, 1000)}) - {129, 139, 405}  # echoed commands; those excluded are answers

_Limits = tuple[float, float]
_METRES: _Limits = (-1e6, 1e6)
_SPEEDS: _Limits = (-10.0, 10.0)
_RAW: _Limits = (-32768.0, 32768.0)
_DEGREES: _Limits = (-360.0, 360.0)
_VOLTS: _Limits = (1.0, 60.0)

_decode = msgspec.json.Decoder().decode


class WaveshareCodec(LineCodec):
    """Codec of one board. ``main`` and ``module`` are numbers of T 900; ``timeout``: of its dead-man, s."""

    stop: ClassVar[bytes] = b'{"T":1,"L":0,"R":0}\n{"T":0}\n'

    def __init__(self, *, main: int, module: int, timeout: float) -> None:
        super().__init__(LONGEST_LINE)
        self._main = main
        self._module = module
        self._timeout = round(timeout * 1000)
        self.gimbal_stop = b'{"T":135}\n' if module == PAN_TILT else b""

    def _event(self, line: bytes) -> UgvEvent | None:
        """Decode one line; plain text is ignored, because the board prints it while it boots."""
        try:
            said = _decode(line)
        except (msgspec.DecodeError, ValueError, RecursionError):  # ValueError: no UTF-8
            said = None
        kind = said.get("T") if isinstance(said, dict) else None
        if not isinstance(kind, int) or isinstance(kind, bool):
            self.garbage += 1
            return None
        if kind == 1001:
            return self._feedback(said)
        if kind == 136 and said.get("cmd") == self._timeout:
            return Confirmed()
        if kind == 1005:
            return BaseFault("a servo of the configured module does not answer; is it attached?")
        if kind not in COMMANDS and kind not in {129, 139, 405, 1002, 1003, 1004}:
            self.garbage += 1
        return None

    def _feedback(self, said: Mapping[str, object]) -> Feedback | None:
        """Decode a feedback; a line without both wheel speeds was corrupted."""
        left, right = _number(said, "L", _SPEEDS), _number(said, "R", _SPEEDS)
        if left is None or right is None:
            self.garbage += 1
            return None
        if "odl" in said:
            return self._ros(said, (left, right))
        volts = _number(said, "v", _VOLTS)
        yaw = _number(said, "y", _DEGREES) if "r" in said else None
        return Feedback(
            speeds=(left, right),
            yaw=None if yaw is None else math.radians(yaw),
            voltage=volts,
            temperature=_number(said, "temp", (-60.0, 150.0)),
        )

    def _ros(self, said: Mapping[str, object], speeds: tuple[float, float]) -> Feedback:
        """Decode a feedback of ugv_base_ros: centimetres, centivolts, raw steps, degrees."""
        odl, odr = _number(said, "odl", _METRES), _number(said, "odr", _METRES)
        centivolts = _number(said, "v", (_VOLTS[0] * 100, _VOLTS[1] * 100))
        has_gimbal = self._module == PAN_TILT
        accel = None if self._module == 1 else _vector(said, "a", ACCEL)  # an arm's fields overwrite it
        return Feedback(
            distances=None if odl is None or odr is None else (odl / 100, odr / 100),
            speeds=speeds,
            gyro=_vector(said, "g", GYRO),
            accel=accel,
            voltage=None if centivolts is None else centivolts / 100,
            pan=_radians(said, "pan") if has_gimbal else None,
            tilt=_radians(said, "tilt") if has_gimbal else None,
        )

    def motion(self, motion: Motion) -> bytes:
        """Return T 1."""
        assert isinstance(motion, Wheels)
        left, right = (min(max(speed, -FASTEST), FASTEST) for speed in (motion.left, motion.right))
        return b'{"T":1,"L":%.4f,"R":%.4f}\n' % (left, right)

    def hello(self) -> bytes:
        """Return the end of a partial line, and one request: the general firmware does not stream yet."""
        return b'\n{"T":130}\n'

    def setup(self) -> bytes:
        """Return the geometry, the dead-man's time (its echo confirms it) and the start of the stream."""
        return (
            b"\n"
            b'{"T":1,"L":0,"R":0}\n'
            b'{"T":900,"main":%d,"module":%d}\n'
            b'{"T":605,"cmd":0}\n'
            b'{"T":143,"cmd":1}\n'
            b'{"T":136,"cmd":%d}\n'
            b'{"T":143,"cmd":0}\n'
            b'{"T":142,"cmd":50}\n'
            b'{"T":131,"cmd":1}\n'
        ) % (self._main, self._module, self._timeout)

    def lights(self, chassis: int, camera: int) -> bytes:
        """Return T 132."""
        return b'{"T":132,"IO4":%d,"IO5":%d}\n' % (chassis, camera)

    def gimbal(self, pan: int, tilt: int) -> bytes:
        """Return T 134 within the firmware's limits."""
        x, y = min(max(pan, -180), 180), min(max(tilt, -30), 90)
        return b'{"T":134,"X":%d,"Y":%d,"SX":%d,"SY":%d}\n' % (x, y, GIMBAL_STEPS, GIMBAL_STEPS)

    def display(self, lines: Sequence[str]) -> bytes:
        """Return T 3 for each line, or T -3."""
        if not lines:
            return b'{"T":-3}\n'
        return b"".join(
            msgspec.json.encode({"T": 3, "lineNum": number, "Text": _plain(text)}) + b"\n"
            for number, text in enumerate(lines[:4])
        )


def _plain(text: str) -> str:
    """Return text with only the characters that the display can show, cut to length."""
    return "".join(letter if " " <= letter <= "~" else "?" for letter in text)[:SHOWN]


def _number(said: Mapping[str, object], name: str, limits: _Limits) -> float | None:
    """Return a number within limits, None for anything else."""
    value = said.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if limits[0] <= value <= limits[1] else None


def _radians(said: Mapping[str, object], name: str) -> float | None:
    """Return in radians an angle that is sent in degrees."""
    degrees = _number(said, name, _DEGREES)
    return None if degrees is None else math.radians(degrees)


def _vector(said: Mapping[str, object], kind: str, step: float) -> Vector3 | None:
    """Return three raw steps as a vector."""
    x, y, z = (_number(said, kind + axis, _RAW) for axis in "xyz")
    return None if x is None or y is None or z is None else Vector3(x * step, y * step, z * step)
