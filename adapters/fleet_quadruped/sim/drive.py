"""Interface of a simulated drive, independent of its protocol."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from fleet import CanFrame
from fleet_quadruped.drives.motor_units import Units
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.sim.brakes import release
from fleet_quadruped.sim.sensors import FULL
from fleet_quadruped.sim.world import SimMotor

STUBBORN = 3  # number of enable commands that a lazy drive ignores
COOL, WARMING = 40.0, 10.0  # degrees C, degrees C per s

Hears = Callable[[CanFrame], None]


class SimEncoder:
    """Encoder of a motor; ``off`` is its error, rad."""

    def __init__(self, motor: SimMotor) -> None:
        self.off = 0.0
        self._motor = motor
        self._stuck: float | None = None  # rad that it reports for ever

    @property
    def angle(self) -> float:
        """Reported angle, rad."""
        return self._motor.angle + self.off if self._stuck is None else self._stuck

    def shift(self, angle: float) -> None:
        """Add an error, rad."""
        self.off += angle

    def stick(self) -> None:
        """Freeze at the present angle."""
        self._stuck = self.angle

    def follow(self) -> None:
        """Update the error of a stuck encoder."""
        if self._stuck is not None:
            self.off = self._stuck - self._motor.angle


class AnyDrive(Protocol):
    """One simulated drive; ``voltage``: V of its supply."""

    joint: Joint
    encoder: SimEncoder
    voltage: float

    @property
    def hears(self) -> Mapping[int, Hears]:
        """Receivers of the frames that the drive understands, by identifier; empty when it is mute."""

    def control(self, dt: float) -> None:
        """Set the motor for the next ``dt`` seconds, about 10 ms at most."""

    def mute(self) -> None:
        """Send nothing any more."""

    def boot(self) -> None:
        """Start as after power-on."""

    def fail(self, why: str) -> None:
        """Enter fault: ``overcurrent`` or ``hot``."""

    def cut_short(self) -> None:
        """Send frames that are too short."""

    def warm(self) -> None:
        """Heat up without end."""

    def doze(self) -> None:
        """Ignore the first few commands to enable it."""

    def pretend(self) -> None:
        """Identify as another device."""

    def refuse(self) -> None:
        """Refuse the configuration."""


class SimDampingDrive:
    """Shared part of simulated drives that damp by themselves; ``send`` sends their frames."""

    def __init__(self, joint: Joint, motor: SimMotor, send: Callable[[CanFrame], None]) -> None:
        self.joint = joint
        self.motor = motor
        self.encoder = SimEncoder(motor)
        self.voltage = FULL
        self.hears: Mapping[int, Hears] = {}
        self._send = send
        self._units = Units(joint)
        self._square = joint.kind.ratio**2
        self._temperature, self._warming = COOL, 0.0
        self._terse = self._refusing = False
        self._dozing = 0  # number of enable commands that it still ignores

    def mute(self) -> None:
        """Send and receive nothing any more."""
        self.hears = {}

    def cut_short(self) -> None:
        """Send only incomplete frames any more."""
        self._terse = True

    def warm(self) -> None:
        """Heat up without end."""
        self._warming = WARMING

    def doze(self) -> None:
        """Ignore the first few commands to enable it."""
        self._dozing = STUBBORN

    def refuse(self) -> None:
        """Ignore writes of its configuration."""
        self._refusing = True

    def control(self, dt: float) -> None:
        """Leave the motor without torque, and update the temperature; a protocol adds its commands."""
        self._temperature += self._warming * dt
        self.encoder.follow()
        release(self.motor)
