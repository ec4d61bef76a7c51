"""One joint of a quadruped with its drive: below the drives and below the description."""

from __future__ import annotations

from typing import NamedTuple

from fleet_quadruped.robot.parts import Actuator


class Joint(NamedTuple):
    """One joint with its drive, in the form that the control loop uses."""

    name: str
    bus: str
    id: int
    sign: int
    offset: float
    low: float
    high: float
    kind: Actuator

    def motor(self, angle: float) -> float:
        """Return the motor angle for a joint angle, rad."""
        return (self.sign * angle + self.offset) * self.kind.ratio

    def angle(self, motor: float) -> float:
        """Return the joint angle for a motor angle, rad."""
        return self.sign * (motor / self.kind.ratio - self.offset)
