"""A point mass with limited acceleration over flat ground; north-east-down, metres, seconds, radians."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

GRAVITY = 9.81  # m/s2


class MotionTarget(NamedTuple):
    """Motion that the autopilot requests.

    Velocity is m/s in NED. ``heading`` (radians from north) overrides ``turn_rate`` (radians per second,
    right positive). Without ``thrust`` the vehicle rests on the ground or falls.
    """

    vn: float = 0.0
    ve: float = 0.0
    vd: float = 0.0
    heading: float | None = None
    turn_rate: float = 0.0
    thrust: bool = True


@dataclass(frozen=True, slots=True)
class Agility:
    """Limits of acceleration: m/s2 horizontally and vertically; and of the turn rate, rad/s."""

    across: float
    along: float
    turn: float


@dataclass(slots=True)
class Body:
    """Position of the vehicle (metres from its start) and its motion."""

    north: float = 0.0
    east: float = 0.0
    down: float = 0.0
    vn: float = 0.0
    ve: float = 0.0
    vd: float = 0.0
    heading: float = 0.0
    turn_rate: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0

    @property
    def height(self) -> float:
        """Metres above the ground."""
        return -self.down

    @property
    def grounded(self) -> bool:
        """True while the vehicle stands on the ground."""
        return self.down >= -0.02 and self.vd >= -0.05

    @property
    def speed(self) -> float:
        """Horizontal speed, m/s."""
        return math.hypot(self.vn, self.ve)

    def advance(self, aim: MotionTarget, agility: Agility, drift: tuple[float, float], dt: float) -> None:
        """Advance by ``dt`` seconds (at most about 0.05); ``drift``: effect of the wind, m/s NE."""
        if aim.thrust:
            self._steer(aim, agility, dt)
        else:
            self.turn_rate = self.roll = self.pitch = 0.0
            self.vd += GRAVITY * dt
        if self.down >= 0.0 and self.vd >= 0.0:
            self._rest()
            return
        self.north += (self.vn + drift[0]) * dt
        self.east += (self.ve + drift[1]) * dt
        self.down += self.vd * dt
        if self.down >= 0.0:
            self._rest()

    def _rest(self) -> None:
        """Stop on the ground."""
        self.down = self.vn = self.ve = self.vd = self.roll = self.pitch = 0.0

    def _steer(self, aim: MotionTarget, agility: Agility, dt: float) -> None:
        """Change velocity and heading towards the requested motion, within the limits."""
        dvn, dve = aim.vn - self.vn, aim.ve - self.ve
        change = math.hypot(dvn, dve)
        share = min(1.0, agility.across * dt / change) if change > 0.0 else 0.0
        self.vn += dvn * share
        self.ve += dve * share
        self.vd += _limited(aim.vd - self.vd, agility.along * dt)
        self._lean(dvn * share / dt, dve * share / dt)
        rate = aim.turn_rate
        if aim.heading is not None:
            rate = 2.0 * math.remainder(aim.heading - self.heading, math.tau)
        self.turn_rate = _limited(rate, agility.turn)
        self.heading = (self.heading + self.turn_rate * dt) % math.tau

    def _lean(self, north: float, east: float) -> None:
        """Set roll and pitch (radians, FRD) from the acceleration in m/s2."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        self.pitch = -math.atan2(cos * north + sin * east, GRAVITY)
        self.roll = math.atan2(cos * east - sin * north, GRAVITY)


def _limited(value: float, limit: float) -> float:
    """Clamp ``value`` to plus or minus ``limit``."""
    return max(-limit, min(limit, value))


def approach(distance: float, speed: float, acceleration: float) -> float:
    """Return the approach speed for ``distance`` with which the vehicle stops at its end."""
    return min(speed, distance, math.sqrt(acceleration * distance))
