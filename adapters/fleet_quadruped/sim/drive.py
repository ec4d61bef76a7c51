"""What the simulated dog asks of a simulated drive, whatever its protocol."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from fleet import CanFrame
from fleet_quadruped.drives.motor_units import Units
from fleet_quadruped.robot.description import Joint
from fleet_quadruped.sim.brakes import let_go
from fleet_quadruped.sim.sensors import FULL
from fleet_quadruped.sim.world import Motor

STUBBORN = 3  # times that a lazy drive does not hear that it is to be enabled
COOL, WARMING = 40.0, 10.0  # degrees C, and by the second

Hears = Callable[[CanFrame], None]


class SimEncoder:
    """What a drive believes of where its motor is; ``off`` is by how much it errs, rad."""

    def __init__(self, motor: Motor) -> None:
        self.off = 0.0
        self._motor = motor
        self._stuck: float | None = None  # rad that it says for ever

    @property
    def angle(self) -> float:
        """What it says, rad."""
        return self._motor.angle + self.off if self._stuck is None else self._stuck

    def shift(self, angle: float) -> None:
        """Be off by an angle more, rad."""
        self.off += angle

    def stick(self) -> None:
        """Say the same for ever."""
        self._stuck = self.angle

    def follow(self) -> None:
        """Note how far the motor has gone on from where a stuck one says that it is."""
        if self._stuck is not None:
            self.off = self._stuck - self._motor.angle


class AnyDrive(Protocol):
    """One simulated drive; ``voltage`` is what its supply has, V."""

    joint: Joint
    encoder: SimEncoder
    voltage: float

    @property
    def hears(self) -> Mapping[int, Hears]:
        """What takes the frames that the drive understands, by their identifiers; none when it is mute."""

    def control(self, dt: float) -> None:
        """Set the motor for the next ``dt`` seconds, at most a hundredth or so."""

    def mute(self) -> None:
        """Say nothing any more."""

    def boot(self) -> None:
        """Start as after power-on."""

    def fail(self, why: str) -> None:
        """Go into fault: ``overcurrent`` or ``hot``."""

    def cut_short(self) -> None:
        """Send frames that are too short."""

    def warm(self) -> None:
        """Become warmer, for good."""

    def doze(self) -> None:
        """Miss the first few times that it is to be enabled."""

    def pretend(self) -> None:
        """Be another device."""

    def refuse(self) -> None:
        """Refuse to be configured."""


class SimDampingDrive:
    """What the simulated drives share that damp by themselves; ``send`` puts their frames on the bus."""

    def __init__(self, joint: Joint, motor: Motor, send: Callable[[CanFrame], None]) -> None:
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
        self._dozing = 0  # times that it does not hear that it is to be enabled

    def mute(self) -> None:
        """Say and hear nothing any more."""
        self.hears = {}

    def cut_short(self) -> None:
        """Send no whole frame any more."""
        self._terse = True

    def warm(self) -> None:
        """Become warmer, for good."""
        self._warming = WARMING

    def doze(self) -> None:
        """Miss the first few times that it is to be enabled."""
        self._dozing = STUBBORN

    def refuse(self) -> None:
        """Keep its configuration as it is."""
        self._refusing = True

    def control(self, dt: float) -> None:
        """Let the motor turn freely, and become warmer; a protocol adds what it is told to do."""
        self._temperature += self._warming * dt
        self.encoder.follow()
        let_go(self.motor)
