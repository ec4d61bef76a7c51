"""What ArduRover does at a time: roll, brake, coast. The times are those of the recordings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from fleet_mavlink.sim.manoeuvres import Manoeuvre
from fleet_mavlink.sim.physics import Aim
from fleet_mavlink.sim.speaker import WARNING

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot

HELD, BRAKED, TIMED_OUT, DISARMED = 2.05, 1.4, 1.05, 1.6  # s over which the speed dies away
_OVERSHOOT = 1.15  # of the speed that is asked for


class Coast(Manoeuvre):
    """Let the speed die away over ``easing`` seconds; 0: brake and stand (LOITER)."""

    in_air_state = 0

    def __init__(self, easing: float) -> None:
        self._easing = easing

    def aim(self, pilot: Autopilot) -> Aim:
        """Return no motion."""
        pilot.body.easing = self._easing  # type: ignore[attr-defined]
        return Aim()


class Roll(Coast):
    """Drive at a speed, to a heading or at a rate of turn, until the setpoint is too old."""

    def __init__(self, speed: float, heading: float | None, rate: float, until: float) -> None:
        super().__init__(TIMED_OUT)
        self._speed = speed
        self._heading = heading
        self._rate = rate
        self._until = until
        self._told = False

    def aim(self, pilot: Autopilot) -> Aim:
        """Return the drive; after 3 s without a setpoint it says so and brakes."""
        if pilot.time > self._until:
            if not self._told:
                self._told = True
                pilot.say(WARNING, "target not received last 3secs, stopping")
            return super().aim(pilot)
        heading = pilot.body.heading if self._heading is None else self._heading
        speed = self._speed * _OVERSHOOT
        return Aim(speed * math.cos(heading), speed * math.sin(heading), 0.0, self._heading, self._rate)
