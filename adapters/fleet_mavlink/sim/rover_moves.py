"""Manoeuvres of ArduRover: roll, brake, coast. The times are those of recordings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, cast

from fleet_mavlink.sim.manoeuvres import GoToManoeuvre, Manoeuvre
from fleet_mavlink.sim.message_output import WARNING
from fleet_mavlink.sim.physics import MotionTarget

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot
    from fleet_mavlink.sim.rover import SimArduRover

HELD, BRAKED, TIMED_OUT, DISARMED = 2.05, 1.4, 1.05, 1.6  # s: time constants of the speed
_THERE = 0.35  # m
_OVERSHOOT = 1.15  # times the requested speed


class Coast(Manoeuvre):
    """Let the speed decay over ``easing`` seconds; 0: brake and stand (LOITER)."""

    in_air_state = 0

    def __init__(self, easing: float) -> None:
        self._easing = easing

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return no motion."""
        pilot.body.easing = self._easing  # type: ignore[attr-defined]
        return MotionTarget()


class DriveAtSpeed(Coast):
    """Drive at a speed, to a heading or at a yaw rate, until the setpoint is too old.

    A negative speed is in reverse.
    """

    def __init__(self, speed: float, heading: float | None, rate: float, until: float) -> None:
        super().__init__(TIMED_OUT)
        self._speed = speed
        self._heading = heading
        self._rate = rate
        self._until = until
        self._reported = False

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the drive; after 3 s without a setpoint it reports that and brakes."""
        if pilot.time > self._until:
            if not self._reported:
                self._reported = True
                pilot.say(WARNING, "target not received last 3secs, stopping")
            return super().aim(pilot)
        body = pilot.body
        body.backwards = self._speed < 0.0  # type: ignore[attr-defined]
        heading = body.heading if self._heading is None else self._heading
        speed = self._speed * _OVERSHOOT
        return MotionTarget(
            speed * math.cos(heading), speed * math.sin(heading), 0.0, self._heading, self._rate
        )


class DriveToPosition(GoToManoeuvre):
    """Drive to a position, in reverse by DO_SET_REVERSE, and stand there."""

    def __init__(self, north: float, east: float) -> None:
        super().__init__(north, east, 0.0)

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the drive towards the position; it stops within 0.4 m."""
        rover = cast("SimArduRover", pilot)
        body = rover.body
        body.backwards, body.easing = rover.reversed, 0.0
        there = self.done or math.hypot(self.north - body.north, self.east - body.east) < _THERE
        wanted = MotionTarget() if there else super().aim(pilot)
        self.done = there  # not that of a copter, which is wider
        return wanted
