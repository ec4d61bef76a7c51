"""Body of an aircraft with wings: it flies along its nose, turns by banking, and has a lowest speed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from fleet_mavlink.sim.physics import GRAVITY, Agility, Body, MotionTarget

_BANK = math.radians(45.0)
_PUSH = 4.0  # m/s2, of the propeller and of the brakes
_STEERS = 1.5  # 1/s
WING_SPEED = 10.0  # m/s; faster, a hovering VTOL is slowing down from its wings


@dataclass(slots=True)
class WingedBody(Body):
    """``slowest``: m/s of lift-off, and lowest speed in the air."""

    slowest: float = 9.0

    def advance(self, aim: MotionTarget, agility: Agility, drift: tuple[float, float], dt: float) -> None:
        """Advance by ``dt`` seconds: turn to the requested velocity, fly along the nose."""
        speed, wanted = self.speed, math.hypot(aim.vn, aim.ve)
        if not self.grounded:
            wanted = max(self.slowest, wanted)
        speed += max(-_PUSH * dt, min(_PUSH * dt, wanted - speed))
        self._turn(aim, max(speed, self.slowest), dt)
        self.vn, self.ve = speed * math.cos(self.heading), speed * math.sin(self.heading)
        climb = aim.vd if speed >= self.slowest else max(0.0, aim.vd)
        self.vd += max(-agility.along * dt, min(agility.along * dt, climb - self.vd))
        self.pitch = math.atan2(-self.vd, max(speed, 1.0))
        self.north += (self.vn + drift[0]) * dt
        self.east += (self.ve + drift[1]) * dt
        self.down = min(0.0, self.down + self.vd * dt)
        if self.down >= 0.0:
            self.vd, self.roll, self.pitch = min(0.0, self.vd), 0.0, 0.0

    def _turn(self, aim: MotionTarget, speed: float, dt: float) -> None:
        """Turn the nose towards the requested direction, as fast as the bank permits."""
        most = GRAVITY * math.tan(_BANK) / speed
        left = math.remainder(math.atan2(aim.ve, aim.vn) - self.heading, math.tau)
        still = aim.vn == 0.0 and aim.ve == 0.0
        self.turn_rate = 0.0 if still else max(-most, min(most, _STEERS * left))
        self.roll = math.atan2(self.turn_rate * speed, GRAVITY)
        self.heading = (self.heading + self.turn_rate * dt) % math.tau


@dataclass(slots=True)
class VtolBody(WingedBody):
    """``hovers``: its rotors carry it, and it moves like a multirotor.

    ``slows``: m/s2, largest deceleration of its rotors from the speed of its wings.
    """

    hovers: bool = True
    slows: float = math.inf

    def advance(self, aim: MotionTarget, agility: Agility, drift: tuple[float, float], dt: float) -> None:
        """Advance by ``dt`` seconds."""
        if self.hovers:
            if self.speed > WING_SPEED:
                agility = replace(agility, across=min(agility.across, self.slows))
            Body.advance(self, aim, agility, drift, dt)
        else:
            WingedBody.advance(self, aim, agility, drift, dt)
