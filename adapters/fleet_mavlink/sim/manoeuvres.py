"""Manoeuvres of an autopilot: each turns the state of its vehicle into a requested motion."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

from fleet_mavlink.sim.physics import MotionTarget, approach

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot

_NOSE_RATE = 0.9  # rad/s at which the nose turns into the direction of travel
_NOSE_BEYOND = 1.0  # m; at this distance from a position the nose begins to turn to it
ON_GROUND, IN_AIR, TAKING_OFF, LANDING = 1, 2, 3, 4  # MAV_LANDED_STATE


class NedPosition(Protocol):
    """A position: metres NED."""

    north: float
    east: float
    down: float


class Manoeuvre:
    """Base: rest with the motors idle; a vehicle in the air falls."""

    in_air_state = IN_AIR
    done = False  # the manoeuvre has reached its goal

    def aim(self, pilot: Autopilot) -> MotionTarget:  # noqa: ARG002 - for subclasses
        """Return the requested motion; called once per physics step."""
        return MotionTarget(thrust=False)


class Idle(Manoeuvre):
    """Motors idle or off."""


def aim_at(pilot: Autopilot, place: NedPosition, speed: float, heading: float | None) -> MotionTarget:
    """Return the motion that brings the vehicle to a position and keeps it there."""
    body = pilot.body
    dn, de, dd = place.north - body.north, place.east - body.east, place.down - body.down
    distance = math.hypot(dn, de)
    pace = approach(distance, speed, pilot.agility.across) / distance if distance > 1e-6 else 0.0
    vd = max(-pilot.speeds.climb, min(pilot.speeds.sink, dd))
    return MotionTarget(dn * pace, de * pace, vd, heading)


class GoToManoeuvre(Manoeuvre):
    """Fly to a position and hold it; with ``heading`` None the nose turns by the autopilot's default."""

    def __init__(
        self,
        north: float,
        east: float,
        down: float,
        *,
        heading: float | None = None,
        speed: float | None = None,
    ) -> None:
        self.north = north
        self.east = east
        self.down = down
        self.heading = heading
        self.speed = speed

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the motion towards the position."""
        body = pilot.body
        flat = math.hypot(self.north - body.north, self.east - body.east)
        self.done = flat < 0.5 and abs(self.down - body.down) < 0.4
        heading = self.heading
        if heading is None and flat > _NOSE_BEYOND and pilot.speeds.yaw_follows_course:
            heading = math.atan2(self.east - body.east, self.north - body.north)
        return aim_at(pilot, self, self.speed or pilot.speeds.cruise, heading)


class OnGround(GoToManoeuvre):
    """Have a position as the target, and rest on the ground."""

    def aim(self, pilot: Autopilot) -> MotionTarget:  # noqa: ARG002 - independent of the state
        """Return no motion."""
        return MotionTarget(thrust=False)


def resting(wanted: Manoeuvre) -> Manoeuvre:
    """Return what a vehicle on the ground makes of a setpoint: it only keeps the target."""
    return OnGround(*place_of(wanted)) if isinstance(wanted, GoToManoeuvre) else Idle()


def place_of(place: NedPosition) -> tuple[float, float, float]:
    """Return a position as north, east, down."""
    return place.north, place.east, place.down


def braked(pilot: Autopilot) -> GoToManoeuvre:
    """Return the manoeuvre that stays where braking from the present motion ends."""
    body = pilot.body
    braking = body.speed / (2 * pilot.agility.across)
    north, east = body.north + body.vn * braking, body.east + body.ve * braking
    return GoToManoeuvre(north, east, body.down, heading=body.heading)


def hold(pilot: Autopilot) -> Manoeuvre:
    """Return the manoeuvre that brakes and stays; idle on the ground."""
    if pilot.body.grounded:
        return Idle()
    return braked(pilot)


class Takeoff(Manoeuvre):
    """Spin up, climb straight to ``down``, hold there."""

    in_air_state = TAKING_OFF

    def __init__(self, pilot: Autopilot, down: float) -> None:
        self.north = pilot.body.north
        self.east = pilot.body.east
        self.down = down
        self.heading = pilot.body.heading
        self.lift_at = pilot.time + (pilot.spin_up if pilot.body.grounded else 0.0)

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return no motion while the motors spin up, then upwards."""
        if pilot.time < self.lift_at:
            return MotionTarget(thrust=False)
        wanted = aim_at(pilot, self, pilot.speeds.cruise, self.heading)
        self.done = abs(self.down - pilot.body.down) < 0.2
        if self.done:
            self.in_air_state = IN_AIR
        return MotionTarget(wanted.vn, wanted.ve, max(-pilot.speeds.takeoff, wanted.vd), self.heading)


class DriveManoeuvre(Manoeuvre):
    """Hold a velocity (m/s NED) until ``until``, then brake to a standstill."""

    def __init__(
        self,
        velocity: tuple[float, float, float],
        *,
        heading: float | None = None,
        turn_rate: float | None = None,
        until: float = math.inf,
    ) -> None:
        self.velocity = velocity
        self.heading = heading
        self.turn_rate = turn_rate
        self.until = until

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the velocity within the vehicle's own limits."""
        if pilot.time > self.until:
            return MotionTarget()
        vn, ve, vd = self.velocity
        speed = math.hypot(vn, ve)
        share = min(1.0, pilot.speeds.top / speed) if speed > 0.0 else 1.0
        rate = self.turn_rate
        if self.heading is None and rate is None and pilot.speeds.yaw_follows_course and speed > 0.3:
            left = math.remainder(math.atan2(ve, vn) - pilot.body.heading, math.tau)
            rate = max(-_NOSE_RATE, min(_NOSE_RATE, 2.0 * left))
        vd = max(-pilot.speeds.climb, min(pilot.speeds.sink, vd))
        return MotionTarget(vn * share, ve * share, vd, self.heading, rate or 0.0)


class Turn(Manoeuvre):
    """Stay at the position and turn to ``heading`` at ``rate`` rad/s."""

    def __init__(self, pilot: Autopilot, heading: float, rate: float, direction: int) -> None:
        self._stay = hold(pilot)
        self._heading = heading
        self._rate = rate
        self._direction = direction

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the motion that stays and turns."""
        stay = self._stay.aim(pilot)
        left = math.remainder(self._heading - pilot.body.heading, math.tau)
        if abs(left) < 0.05 or self._direction == 0:
            self._direction = 0
            return MotionTarget(stay.vn, stay.ve, stay.vd, self._heading)
        return MotionTarget(stay.vn, stay.ve, stay.vd, None, math.copysign(self._rate, self._direction))


class Sink(Manoeuvre):
    """Descend at ``speed`` m/s without holding the position (no stick input, no position)."""

    def __init__(self, speed: float) -> None:
        self._speed = speed

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return straight down."""
        return MotionTarget(vd=self._speed, heading=pilot.body.heading)


class Land(Manoeuvre):
    """Land at a position, by default the present one; slower near the ground."""

    in_air_state = LANDING

    def __init__(self, pilot: Autopilot, place: NedPosition | None = None) -> None:
        here = place or braked(pilot)
        self.begun = pilot.time
        self.north = here.north
        self.east = here.east
        self.down = 0.0
        self.heading = pilot.body.heading

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return down at the autopilot's landing speed; idle after touch-down."""
        if pilot.body.grounded:
            self.done = True
            return MotionTarget(thrust=False)
        fast, slow, slow_below = pilot.speeds.landing
        flat = aim_at(pilot, self, pilot.speeds.cruise, None) if pilot.has_position else MotionTarget()
        vd = slow if pilot.body.height < slow_below else fast
        return MotionTarget(flat.vn, flat.ve, vd, self.heading)


class Return(Manoeuvre):
    """Climb to ``height`` above home, fly home, wait ``wait`` seconds, land; on the ground rest."""

    def __init__(self, pilot: Autopilot, height: float, wait: float) -> None:
        home_north, home_east, home_down = pilot.home.ned()
        down = min(pilot.body.down, home_down - height)
        here = pilot.body
        self._legs = [
            GoToManoeuvre(here.north, here.east, down, heading=here.heading),
            GoToManoeuvre(home_north, home_east, down),
        ]
        self._wait = wait
        self._land_at: float | None = None
        self._land = Land(pilot) if pilot.land_detector.landed else None

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the motion of the present leg."""
        if self._land is not None:
            self.done = self._land.done
            return self._land.aim(pilot)
        wanted = self._legs[0].aim(pilot)
        if not self._legs[0].done:
            return wanted
        if len(self._legs) > 1:
            del self._legs[0]
        elif self._land_at is None:
            self._land_at = pilot.time + self._wait
        elif pilot.time >= self._land_at:
            self.in_air_state = LANDING
            self._land = Land(pilot, self._legs[0])
        return wanted
