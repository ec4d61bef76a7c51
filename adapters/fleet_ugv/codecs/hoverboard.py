"""Hoverboard mainboards with the FOC firmware (EFeru), 115200 baud, little-endian, checksummed.

Command: start 0xABCD, steer, speed, XOR of these. Feedback, 18 bytes: start, two inputs, rpm of right and
left wheel, volts x 100, degrees x 10, LED, XOR. In speed mode the unit of speed is one rpm; the firmware's
mixer gives half of ``steer`` to each side. The firmware stops 0.8 s after the last frame.
"""

from __future__ import annotations

import functools
import math
import operator
import struct
from collections.abc import Sequence
from typing import ClassVar

from fleet_ugv.codecs.base import Codec
from fleet_ugv.model import Feedback, Motion, UgvEvent, Wheels

START = 0xABCD
LARGEST = 1000  # units of steer and speed
_DOWN = struct.Struct("<HhhH")
_UP = struct.Struct("<HhhhhhhHH")
_MARK = struct.pack("<H", START)


def checksum(frame: bytes) -> int:
    """Return the XOR of all 16-bit words except the last."""
    words: tuple[int, ...] = struct.unpack(f"<{len(frame) // 2}H", frame)
    return functools.reduce(operator.xor, words[:-1])


def frame_of(steer: int, speed: int) -> bytes:
    """Return a command frame."""
    bare = _DOWN.pack(START, steer, speed, 0)
    return bare[:-2] + struct.pack("<H", checksum(bare))


class HoverboardCodec(Codec):
    """Codec of one mainboard; ``diameter`` of its wheels, m."""

    stop: ClassVar[bytes] = frame_of(0, 0)

    def __init__(self, *, diameter: float) -> None:
        self.garbage = 0
        self._speed_of_rpm = math.pi * diameter / 60
        self._rest = b""

    def feed(self, data: bytes) -> Sequence[UgvEvent]:
        """Take received bytes; anything that is not a frame is skipped up to the next start mark."""
        self._rest += data
        events: list[UgvEvent] = []
        while True:
            at = self._rest.find(_MARK)
            if at != 0:
                self._skip(at)
            if len(self._rest) < _UP.size:
                return events
            frame = self._rest[: _UP.size]
            if checksum(frame) != _UP.unpack(frame)[-1]:
                self._rest = self._rest[1:]
                self.garbage += 1
                continue
            self._rest = self._rest[_UP.size :]
            events.append(self._feedback(frame))

    def _skip(self, at: int) -> None:
        """Drop the bytes before the start mark; keep a last byte that may be the first half of one."""
        if at < 0:
            at = len(self._rest) - (1 if self._rest[-1:] == _MARK[:1] else 0)
        self.garbage += 1 if at else 0
        self._rest = self._rest[at:]

    def _feedback(self, frame: bytes) -> Feedback:
        """Decode a feedback frame."""
        _, _, _, right, left, volts, degrees, _, _ = _UP.unpack(frame)
        return Feedback(
            speeds=(left * self._speed_of_rpm, right * self._speed_of_rpm),
            voltage=volts / 100 if volts > 0 else None,
            temperature=degrees / 10,
        )

    def motion(self, motion: Motion) -> bytes:
        """Return the command frame; the caller has scaled both sides together."""
        assert isinstance(motion, Wheels)
        left, right = motion.left / self._speed_of_rpm, motion.right / self._speed_of_rpm
        steer, speed = round(left - right), round((left + right) / 2)
        return frame_of(min(max(steer, -LARGEST), LARGEST), min(max(speed, -LARGEST), LARGEST))
