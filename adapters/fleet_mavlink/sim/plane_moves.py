"""Manoeuvres of a plane: take-off along its nose, circle, passing of a position, landing."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from fleet_mavlink.sim.manoeuvres import LANDING, TAKING_OFF, GoToManoeuvre, Manoeuvre
from fleet_mavlink.sim.physics import MotionTarget

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot

_PULL = 2.0  # gain of the course towards the circle
_ON_IT = 15.0  # m from the circle,
_AT_HEIGHT = 5.0  # and m from its height, that count as reached
_ROTATES = 1.1  # times the lowest speed, at which it rotates
_FLARES = 3.0  # m above the ground; PX4 touches down 4 s later
_GLIDES = 5.0  # m/s of descent on an approach
_TOUCHES = 0.7  # m/s of descent in the flare
_SLOPE = 0.1  # gradient of an approach
_AHEAD = 15.0  # m/s at the end of a transition


def forward(pilot: Autopilot, speed: float, vd: float) -> MotionTarget:
    """Return the motion straight ahead."""
    heading = pilot.body.heading
    return MotionTarget(speed * math.cos(heading), speed * math.sin(heading), vd)


def _vertical(pilot: Autopilot, down: float) -> float:
    """Return the vertical speed towards a height, m/s down."""
    return max(-pilot.speeds.climb, min(pilot.speeds.sink, 0.5 * (down - pilot.body.down)))


class CircleManoeuvre(GoToManoeuvre):
    """Fly to a circle around a position, and along it; a negative radius turns left."""

    def __init__(
        self, north: float, east: float, down: float, radius: float, speed: float | None = None
    ) -> None:
        super().__init__(north, east, down, speed=speed)
        self._radius = radius

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the motion to the circle, and along it."""
        body, radius = pilot.body, abs(self._radius)
        north, east = body.north - self.north, body.east - self.east
        off = math.hypot(north, east) - radius
        self.done = abs(off) < _ON_IT and abs(self.down - body.down) < _AT_HEIGHT
        course = math.pi / 2 + math.atan(_PULL * off / radius)
        course = math.atan2(east, north) + math.copysign(course, self._radius)
        speed = self.speed or pilot.speeds.cruise
        return MotionTarget(speed * math.cos(course), speed * math.sin(course), _vertical(pilot, self.down))


class FlyOver(GoToManoeuvre):
    """Fly over a position, which counts as reached within ``within`` m."""

    def __init__(self, north: float, east: float, down: float, within: float) -> None:
        super().__init__(north, east, down)
        self._within = within

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the motion straight to the position."""
        body = pilot.body
        north, east = self.north - body.north, self.east - body.east
        self.done = self.done or math.hypot(north, east) < self._within
        course, speed = math.atan2(east, north), self.speed or pilot.speeds.cruise
        return MotionTarget(speed * math.cos(course), speed * math.sin(course), _vertical(pilot, self.down))


class RunwayTakeoff(Manoeuvre):
    """Roll, lift off at the take-off speed, climb straight ahead to ``down``."""

    in_air_state = TAKING_OFF

    def __init__(self, down: float) -> None:
        self.down = down

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the roll, then the climb."""
        body, cruise = pilot.body, pilot.speeds.cruise
        self.done = body.down <= self.down
        lifts = body.speed >= _ROTATES * body.slowest  # type: ignore[attr-defined]
        return forward(pilot, cruise, -pilot.speeds.takeoff if lifts or not body.grounded else 0.0)


class Touchdown(Manoeuvre):
    """Flare straight ahead, touch down, and roll out."""

    in_air_state = LANDING

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the flare; brake on the ground."""
        body = pilot.body
        if not body.grounded:
            return forward(pilot, pilot.speeds.cruise, _TOUCHES)
        self.done = body.speed < 0.5
        return MotionTarget(thrust=body.speed > 0.0)


class CircleDown(CircleManoeuvre):
    """Descend in circles to the flare, and land."""

    in_air_state = LANDING

    def __init__(self, pilot: Autopilot, radius: float) -> None:
        super().__init__(pilot.body.north, pilot.body.east, 0.0, radius)
        self._touchdown = Touchdown()

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the circle, then the flare."""
        if pilot.body.height > _FLARES:
            around = super().aim(pilot)
            self.done = False
            return MotionTarget(around.vn, around.ve, pilot.speeds.landing[0])
        wanted = self._touchdown.aim(pilot)
        self.done = self._touchdown.done
        return wanted


class LandingApproach(Manoeuvre):
    """Descend along a slope to a position, and land there."""

    in_air_state = LANDING

    def __init__(self, north: float, east: float) -> None:
        self._north = north
        self._east = east
        self._left = math.inf
        self._touchdown = Touchdown()

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the slope, then the flare."""
        body = pilot.body
        if body.height <= _FLARES:
            wanted = self._touchdown.aim(pilot)
            self.done = self._touchdown.done
            return wanted
        north, east = self._north - body.north, self._east - body.east
        self._left = min(self._left, math.hypot(north, east))  # beyond the position it keeps descending
        course, speed = math.atan2(east, north), pilot.speeds.cruise
        above = body.height - max(_FLARES - 1.0, _SLOPE * self._left)
        vd = max(-pilot.speeds.climb, min(_GLIDES, 0.5 * above))
        return MotionTarget(speed * math.cos(course), speed * math.sin(course), vd)


class Ahead(Manoeuvre):
    """Fly straight ahead at a height, with increasing speed."""

    def __init__(self, down: float) -> None:
        self._down = down

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the motion straight ahead."""
        return forward(pilot, _AHEAD, _vertical(pilot, self._down))
