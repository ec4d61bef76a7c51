"""A tracked rover that speaks ASCII lines over a serial port or TCP.

It obeys ``M <m/s> <rad/s>`` and stops by itself 0.5 s after the last such line; ``L 1`` and ``L 0`` switch
its lamps. It reports ``B <volts> <percent>`` and ``P <x m> <y m> <yaw rad>``.
"""

import re
from collections.abc import Iterable
from typing import Literal

from pydantic import Field

import fleet
from fleet import BatteryReport, PoseReport, Vector3

_SAID = re.compile(rb"([BP])((?: -?\d{1,6}(?:\.\d{1,6})?){2,3})")


class TrackedRoverConfig(fleet.AdapterConfig):
    """Fields of a tracked rover in fleet.yaml."""

    adapter: Literal["tracked-rover"]
    link: fleet.LinkText = Field(description="serial:/dev/...?baud=115200 or tcp:HOST:PORT.")


class TrackedRover(fleet.FrameAdapter[TrackedRoverConfig]):
    """Translates between velocities and the rover's lines."""

    Config = TrackedRoverConfig
    limits = fleet.Limits(speed=1.2, yaw_rate=2.0)
    failsafe = "the rover stops 0.5 s after the last velocity"

    def drive(self, velocity: fleet.Velocity) -> Iterable[bytes]:
        """Yield the line that sets a velocity."""
        yield b"M %.3f %.3f\n" % (velocity.linear.x, velocity.yaw_rate)

    @fleet.command("lights", moves=False)
    def lights(self, *, on: bool = True) -> Iterable[bytes]:
        """Switch the lamps."""
        yield b"L %d\n" % on

    def decode(self, frame: bytes, stamp: float) -> Iterable[BatteryReport | PoseReport]:
        """Yield the report of one line."""
        match = _SAID.fullmatch(frame)
        kind, numbers = (match[1], [float(text) for text in match[2].split()]) if match else (b"", [])
        if kind == b"B" and len(numbers) == 2 and 0 <= numbers[1] <= 100:
            yield BatteryReport(stamp, voltage=numbers[0], percent=numbers[1])
        if kind == b"P" and len(numbers) == 3:
            yield PoseReport(stamp, Vector3(*numbers[:2]), fleet.quaternion_from_yaw(numbers[2]))

    def halt(self) -> Iterable[bytes]:
        """Yield the line that stops the rover."""
        yield b"M 0 0\n"
