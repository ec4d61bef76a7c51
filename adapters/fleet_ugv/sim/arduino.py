"""A simulated ros_arduino_bridge: ASCII words that end with CR; pure."""

from __future__ import annotations

import re

from fleet_ugv.codecs.arduino import PID_RATE
from fleet_ugv.sim.board import SimBoard
from fleet_ugv.sim.physics import BaseBody

_DIGITS = re.compile(r"[+-]?[0-9]+")
LONGEST = 32  # bytes of a word that the sketch can buffer


class ArduinoBoard(SimBoard):
    """A board with two encoders of ``ticks`` per metre."""

    def __init__(self, body: BaseBody, *, ticks: float, seed: int = 1) -> None:
        super().__init__(body, timeout=2.0, voltage=0.0, seed=seed)
        self._ticks = ticks
        self._rest = b""
        self.servos: dict[int, int] = {}

    def restart(self, now: float) -> None:  # noqa: ARG002 - it starts at once
        """Reset the board."""
        self.physics.wanted = [0.0, 0.0]
        self.physics.distances = [0.0, 0.0]
        self._rest = b""

    def handle_bytes(self, data: bytes, now: float) -> bytes:
        """Answer the words, one by one."""
        *words, self._rest = (self._rest + data).split(b"\r")
        self._rest = self._rest[:LONGEST]
        return b"".join(self._answer(word[:LONGEST], now) for word in words)

    def _answer(self, word: bytes, now: float) -> bytes:
        """Carry out one word."""
        kind, *numbers = word.decode("ascii", "replace").split() or [""]
        values = [_whole(number) for number in (*numbers, "", "")]  # an argument that is missing is 0
        match kind:
            case "e":
                left, right = (int(distance * self._ticks) for distance in self.physics.distances)
                return b"%d %d\r\n" % (left, right)
            case "m":
                left, right = values[:2]
                speed = PID_RATE / self._ticks
                self.hold(left * speed, right * speed, now)
            case "r":
                self.physics.distances = [0.0, 0.0]
            case "s":
                self.servos[values[0]] = values[1]
            case "b":
                return b"57600\r\n"
            case "u":
                pass
            case "":
                return b""
            case _:
                return b"Invalid Command\r\n"
        return b"OK\r\n"

    def speak(self, now: float) -> bytes:  # noqa: ARG002 - it never does
        """Send nothing: this board only answers."""
        return b""


def _whole(text: str) -> int:
    """Parse a number like C's atoi: the digits that it begins with, 0 without any."""
    found = _DIGITS.match(text)
    return int(found[0]) if found else 0
