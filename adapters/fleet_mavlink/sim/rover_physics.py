"""A wheeled vehicle on flat ground: moves along its nose, coasts or brakes."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fleet_mavlink.sim.physics import Agility, Body, MotionTarget

_TURN_SPEED = 0.3  # m/s; below it the wheels hardly turn the vehicle
_TURN_GAIN = 2.0  # 1/s


@dataclass(slots=True)
class WheeledBody(Body):
    """``easing``: time constant (s) of a coasting speed; 0: it brakes as hard as it can.

    ``backwards``: drive in reverse. ``skid``: it can turn while standing.
    """

    easing: float = 0.0
    along: float = 0.0  # m/s, forward
    backwards: bool = False
    skid: bool = False

    def advance(self, aim: MotionTarget, agility: Agility, drift: tuple[float, float], dt: float) -> None:  # noqa: ARG002
        """Advance by ``dt`` seconds: turn to the requested velocity, drive along the nose."""
        wanted = math.hypot(aim.vn, aim.ve) * (-1.0 if self.backwards else 1.0)
        self.turn_rate = self._turning(aim, wanted, agility)
        self.heading = (self.heading + self.turn_rate * dt) % math.tau
        if wanted == 0.0 and self.easing:
            self.along *= math.exp(-dt / self.easing)
        else:
            most = agility.across * dt
            self.along += max(-most, min(most, wanted - self.along))
        self.vn, self.ve = self.along * math.cos(self.heading), self.along * math.sin(self.heading)
        self.north += self.vn * dt
        self.east += self.ve * dt

    def _turning(self, aim: MotionTarget, wanted: float, agility: Agility) -> float:
        """Return the turn rate, rad/s: on steered wheels it must move to turn."""
        rate = aim.turn_rate
        if wanted and not rate:
            heading = math.atan2(aim.ve, aim.vn) if aim.heading is None else aim.heading
            heading += math.pi if self.backwards else 0.0
            rate = _TURN_GAIN * math.remainder(heading - self.heading, math.tau)
        rolls = min(1.0, max(abs(self.along), abs(wanted) * 0.5) / _TURN_SPEED)
        most = agility.turn * (1.0 if self.skid else rolls)
        return max(-most, min(most, rate))
