"""ros_arduino_bridge: ASCII words that end with CR, 57600 baud.

``m L R`` sets encoder ticks per PID period (30 Hz) and is answered ``OK``; ``e`` requests both counters.
``s ID DEGREES`` sets a servo. The firmware stops 2 s after the last ``m``. An answer does not name its
request, but each kind has a form of its own, so none is mistaken for another.
"""

from __future__ import annotations

import math
import re
from typing import ClassVar

import msgspec

from fleet_ugv.codecs.base import LineCodec
from fleet_ugv.model import AckermannCommand, BaseFault, Feedback, Motion, UgvEvent, Wheels

PID_RATE = 30.0  # Hz
LONGEST_LINE = 256  # bytes, more than the longest line of the board
LARGEST = 32767  # ticks per period, the largest 16-bit int of the firmware
COUNTER = 2**32  # ticks at which the counters wrap around
_COUNTERS = re.compile(rb"(-?\d{1,10}) (-?\d{1,10})")


class Servo(msgspec.Struct, frozen=True):
    """The steering servo: its number, its angle straight ahead, and servo degrees per radian to the left."""

    number: int = 0
    centre: float = 90.0
    gain: float = math.degrees(1.0)


class ArduinoCodec(LineCodec):
    """Codec of one board; ``ticks``: encoder ticks per metre; ``servo`` for a robot with steering."""

    stop: ClassVar[bytes] = b"\rm 0 0\r"

    def __init__(self, *, ticks: float, servo: Servo | None = None) -> None:
        super().__init__(LONGEST_LINE)
        self._ticks = ticks
        self._servo = servo or Servo()

    def _event(self, line: bytes) -> UgvEvent | None:
        """Decode one answer, which may follow an echo of its request."""
        line = line.rpartition(b"\r")[2].strip()
        counters = _COUNTERS.fullmatch(line)
        if counters is not None:
            left, right = int(counters[1]), int(counters[2])
            return Feedback(distances=(left / self._ticks, right / self._ticks))
        if line.startswith(b"Invalid Command"):
            return BaseFault("the board does not know a command; is it ros_arduino_bridge?")
        if line != b"OK":
            self.garbage += 1
        return None

    def motion(self, motion: Motion) -> bytes:
        """Return ``m``, preceded by ``s`` for a robot with steering."""
        if isinstance(motion, AckermannCommand):
            angle = self._servo.centre + self._servo.gain * motion.angle
            turned = b"s %d %d\r" % (self._servo.number, min(max(round(angle), 0), 180))
            return turned + self._speeds(Wheels(motion.speed, motion.speed))
        return self._speeds(motion)

    def _speeds(self, wheels: Wheels) -> bytes:
        """Return ``m``."""
        ticks = (round(speed * self._ticks / PID_RATE) for speed in (wheels.left, wheels.right))
        return b"m %d %d\r" % tuple(min(max(count, -LARGEST), LARGEST) for count in ticks)

    def hello(self) -> bytes:
        """Return CR, which ends a partial word in the board's buffer."""
        return b"\r"

    def setup(self) -> bytes:
        """Return a zero speed; the dead-man's time is fixed in the firmware."""
        return self.stop

    def poll(self) -> bytes:
        """Return the request for the counters."""
        return b"e\r"
