"""Flight of the stored mission, item by item."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, ClassVar

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.manoeuvres import GoToManoeuvre, Land, Manoeuvre, Takeoff, hold
from fleet_mavlink.sim.mission_items import LOITER_TURNS, Item
from fleet_mavlink.sim.missions import ACTIVE, COMPLETE, NOT_STARTED, PAUSED
from fleet_mavlink.sim.physics import MotionTarget

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot

_RELATIVE_FRAMES = frozenset({3, 6, 10, 11})
_HOLD_FIRST_PARAM = frozenset({16, 19, 82, 93})  # items with a stay of param1 seconds
RTL = 20
_RADIUS = 10.0  # m, default radius of a circle
_AHEAD = 0.5  # rad by which the target is ahead on the circle


def place_of_item(pilot: Autopilot, item: Item) -> tuple[float, float, float]:
    """Return the position of an item; 0/0 means that of the vehicle."""
    altitude = item.z
    if item.frame in _RELATIVE_FRAMES:
        altitude += pilot.home.place[2] if pilot.home.place is not None else pilot.place[2]
    if item.x == 0 and item.y == 0:
        latitude, longitude, _ = pilot.geo()
    else:
        latitude, longitude = item.x / 1e7, item.y / 1e7
    return pilot.frame.ned_of(latitude, longitude, altitude)


def _go(pilot: Autopilot, item: Item) -> Manoeuvre:
    north, east, down = place_of_item(pilot, item)
    heading = math.radians(item.p4) if math.isfinite(item.p4) and item.p4 != 0.0 else None
    return GoToManoeuvre(north, east, down, heading=heading)


def _take_off(pilot: Autopilot, item: Item) -> Manoeuvre:
    return Takeoff(pilot, place_of_item(pilot, item)[2])


class LandThere(Manoeuvre):
    """Fly over the position of the item, then land."""

    def __init__(self, pilot: Autopilot, item: Item) -> None:
        north, east, _ = place_of_item(pilot, item)
        self._legs: list[Manoeuvre] = [GoToManoeuvre(north, east, pilot.body.down)]

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the motion to the position, then down."""
        if self._legs[0].done and not isinstance(self._legs[0], Land):
            self._legs[0] = Land(pilot)
        self.in_air_state = self._legs[0].in_air_state
        wanted = self._legs[0].aim(pilot)
        self.done = self._legs[0].done and isinstance(self._legs[0], Land)
        return wanted


class _Unlimited(Manoeuvre):
    """Fly to the position of the item and stay for ever."""

    def __init__(self, manoeuvre: Manoeuvre) -> None:
        self._manoeuvre = manoeuvre

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the motion to the position."""
        return self._manoeuvre.aim(pilot)


class _CircleItem(Manoeuvre):
    """Fly to the position of the item and circle it; a negative radius turns left."""

    def __init__(self, pilot: Autopilot, item: Item) -> None:
        self._centre = place_of_item(pilot, item)
        self._radius = item.p3 or _RADIUS
        self._left = math.tau * item.p1
        self._bearing: float | None = None
        self._leg = GoToManoeuvre(self._centre[0] + abs(self._radius), self._centre[1], self._centre[2])

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the motion to the circle, then to the position a little ahead on it."""
        if self._bearing is None and not self._leg.done:
            return self._leg.aim(pilot)
        north, east, down = self._centre
        seen = math.atan2(pilot.body.east - east, pilot.body.north - north)
        turn = math.copysign(1.0, self._radius)
        self._left -= turn * math.remainder(
            seen - (seen if self._bearing is None else self._bearing), math.tau
        )
        self._bearing = seen
        self.done = self._left <= 0.0
        ahead, away = seen + turn * _AHEAD, abs(self._radius)
        self._leg = GoToManoeuvre(north + away * math.cos(ahead), east + away * math.sin(ahead), down)
        return self._leg.aim(pilot)


_MANOEUVRES: Mapping[int, Callable[[Autopilot, Item], Manoeuvre]] = {
    16: _go,
    17: lambda pilot, item: _Unlimited(_go(pilot, item)),
    LOITER_TURNS: _CircleItem,
    19: _go,
    31: _go,
    82: _go,
    93: lambda pilot, _item: hold(pilot),
    22: _take_off,
    21: LandThere,
}


class MissionManoeuvre(Manoeuvre):
    """Fly the items from the current one on; ``returns``: an item requests RTL."""

    manoeuvres: ClassVar[Mapping[int, Callable[[Autopilot, Item], Manoeuvre]]] = _MANOEUVRES

    def __init__(self, pilot: Autopilot) -> None:
        missions = pilot.missions
        if missions.state == COMPLETE or missions.current < missions.first:
            missions.current = missions.first
        missions.state = ACTIVE
        self.returns = False
        self._flown = -1  # number of the item being flown
        self._leg: Manoeuvre = hold(pilot)
        self._leave_at: float | None = None

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the motion of the item being flown."""
        missions = pilot.missions
        if not missions.loaded:  # cleared during the flight
            self.done = True
        elif not self.done and self._flown != missions.current:
            self._begin(pilot)
        wanted = self._leg.aim(pilot)
        self.in_air_state = self._leg.in_air_state
        under_way = not self.done and self._flown == missions.current
        if under_way and self._leg.done and self._waited(pilot):
            self._reached(pilot)
        return wanted

    def _begin(self, pilot: Autopilot) -> None:
        """Start the current item."""
        self._flown = pilot.missions.current
        self._leave_at = None
        item = pilot.missions.items[self._flown]
        make = self.manoeuvres.get(item.command)
        if make is not None:
            self._leg = make(pilot, item)
        elif item.command == RTL:
            self.returns = True
        else:
            self._do(pilot, item)

    def _do(self, pilot: Autopilot, item: Item) -> None:
        """Execute an item without motion: it is done at once."""
        if item.command == mav.MAV_CMD_DO_CHANGE_SPEED and item.p2 > 0.0:
            pilot.speeds.requested = item.p2
        self._reached(pilot)

    def _waited(self, pilot: Autopilot) -> bool:
        """Return True once the stay at the item is over."""
        item = pilot.missions.items[self._flown]
        if self._leave_at is None:
            stay = item.p1 if item.command in _HOLD_FIRST_PARAM and math.isfinite(item.p1) else 0.0
            self._leave_at = pilot.time + stay
        return pilot.time >= self._leave_at

    def _reached(self, pilot: Autopilot) -> None:
        """Report that an item is done and go to the next; the number stays below the count."""
        missions = pilot.missions
        pilot.out.append(missions.reached(pilot.time))
        if missions.current + 1 < len(missions.items):
            missions.current += 1
            return
        missions.state = COMPLETE
        self.done = True


def leave_mission(pilot: Autopilot) -> None:
    """Record that the mission is left for another mode."""
    missions = pilot.missions
    if missions.state == ACTIVE:
        missions.state = PAUSED if pilot.armed else NOT_STARTED
