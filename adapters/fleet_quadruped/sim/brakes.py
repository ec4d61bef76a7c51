"""Stops of a simulated CiA 402 drive: the option codes 605Ah, 605Ch and 605Eh as tables, and the braking.

A quick stop does not damp. The drive slows its motor down on a ramp; then it either holds the position with
its full stiffness, or takes the torque off, as 605Ah says.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from fleet_quadruped.sim.world import SimMotor

QUICK_STOP_OPTION, DISABLE_OPTION, FAULT_OPTION = (0x605A, 0), (0x605C, 0), (0x605E, 0)
STIFF, DAMPING = 150.0, 3.0  # N m/rad, N m s/rad: the drive's position loop
_AT_ONCE, _SLOW_DOWN, _QUICK, _HARD = 0.0, 20.0, 100.0, math.inf  # rad/s2; at once: without torque


class BrakeEnd(NamedTuple):
    """One way to stop: deceleration of the motor (rad/s2), and whether it is held afterwards."""

    ramp: float
    holds: bool = False


QUICK_STOPS: Mapping[int, BrakeEnd] = MappingProxyType(
    {
        0: BrakeEnd(_AT_ONCE),
        1: BrakeEnd(_SLOW_DOWN),
        2: BrakeEnd(_QUICK),
        3: BrakeEnd(_HARD),
        4: BrakeEnd(_HARD),
        5: BrakeEnd(_SLOW_DOWN, holds=True),
        6: BrakeEnd(_QUICK, holds=True),
        7: BrakeEnd(_HARD, holds=True),
    }
)
"""605Ah: quick stop option."""
DISABLES: Mapping[int, BrakeEnd] = MappingProxyType({0: BrakeEnd(_AT_ONCE), 1: BrakeEnd(_SLOW_DOWN)})
"""605Ch: disable operation option."""
FAULTS: Mapping[int, BrakeEnd] = MappingProxyType(
    {
        0: BrakeEnd(_AT_ONCE),
        1: BrakeEnd(_SLOW_DOWN),
        2: BrakeEnd(_QUICK),
        3: BrakeEnd(_HARD),
        4: BrakeEnd(_HARD),
    }
)
"""605Eh: fault reaction option."""


class MotorBrake:
    """One stop of one motor, from its position and speed at the start."""

    def __init__(self, ending: BrakeEnd, motor: SimMotor) -> None:
        self.holds = ending.holds
        self._ramp = ending.ramp
        self._speed = motor.speed if _AT_ONCE < ending.ramp < math.inf else 0.0
        self._place = motor.angle
        self.torque = ending.ramp > _AT_ONCE

    @property
    def over(self) -> bool:
        """True once the motor is at rest, or has no torque."""
        return self._speed == 0.0

    def step(self, motor: SimMotor, dt: float) -> None:
        """Set the motor for the next ``dt`` seconds."""
        before = self._speed
        change = self._ramp * dt if self.torque else 0.0
        after = math.copysign(max(0.0, abs(before) - change), before) if before else 0.0
        mean = (before + after) / 2
        motor.kp, motor.kd, motor.feed = STIFF, DAMPING, 0.0
        motor.target, motor.slope, motor.target_speed = self._place, mean, mean
        self._place += mean * dt
        self._speed = after


def release(motor: SimMotor) -> None:
    """Take the torque off."""
    motor.kp = motor.kd = motor.feed = motor.target_speed = motor.slope = 0.0
