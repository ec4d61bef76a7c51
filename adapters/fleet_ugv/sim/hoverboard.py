"""A simulated hoverboard mainboard (FOC firmware): binary frames, feedback every 20 ms; pure."""

from __future__ import annotations

import math
import struct

from fleet_ugv.codecs.hoverboard import START, checksum
from fleet_ugv.sim.board import SimBoard
from fleet_ugv.sim.physics import BaseBody

_DOWN = struct.Struct("<HhhH")
_UP = struct.Struct("<HhhhhhhH")
_MARK = struct.pack("<H", START)


class HoverboardBoard(SimBoard):
    """A mainboard with wheels of ``diameter`` m, in speed mode."""

    def __init__(self, body: BaseBody, *, diameter: float, seed: int = 1) -> None:
        super().__init__(body, timeout=0.8, voltage=38.5, seed=seed)
        self._speed_of_rpm = math.pi * diameter / 60
        self._rest = b""
        self._inputs = (0, 0)
        self._next = 0.0

    def restart(self, now: float) -> None:  # noqa: ARG002 - it starts at once
        """Reset the board."""
        self.physics.wanted = [0.0, 0.0]
        self._rest = b""
        self._inputs = (0, 0)

    def handle_bytes(self, data: bytes, now: float) -> bytes:
        """Handle valid frames; other bytes are skipped one by one."""
        self._rest += data
        while len(self._rest) >= _DOWN.size:
            frame = self._rest[: _DOWN.size]
            if frame.startswith(_MARK) and checksum(frame) == _DOWN.unpack(frame)[3]:
                self._mix(frame, now)
                self._rest = self._rest[_DOWN.size :]
            else:
                self._rest = self._rest[1:]
        return b""

    def _mix(self, frame: bytes, now: float) -> None:
        """Mix steer and speed as the firmware does."""
        _, steer, speed, _ = _DOWN.unpack(frame)
        self._inputs = (steer, speed)
        left, right = (max(-1000.0, min(1000.0, side)) for side in (speed + steer / 2, speed - steer / 2))
        self.hold(left * self._speed_of_rpm, right * self._speed_of_rpm, now)

    def speak(self, now: float) -> bytes:
        """Return a feedback every 20 ms."""
        if now < self._next:
            return b""
        self._next = now + 0.02
        left, right = (round(speed / self._speed_of_rpm) for speed in self.physics.speeds)
        volts = round(self.voltage * 100)
        bare = _UP.pack(START, *self._inputs, right, left, volts, 312, 0) + bytes(2)
        return bare[:-2] + struct.pack("<H", checksum(bare))
