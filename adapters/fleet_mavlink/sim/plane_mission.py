"""Missions of planes: positions are passed, stays are circles, RTL is the mode."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, ClassVar

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.mission_flight import MissionManoeuvre, place_of_item
from fleet_mavlink.sim.physics import MotionTarget
from fleet_mavlink.sim.plane_moves import CircleManoeuvre, FlyOver, LandingApproach, RunwayTakeoff

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot
    from fleet_mavlink.sim.manoeuvres import Manoeuvre
    from fleet_mavlink.sim.mission_items import Item


def _pass(pilot: Autopilot, item: Item) -> Manoeuvre:
    return FlyOver(*place_of_item(pilot, item), pilot.passes_within)  # type: ignore[attr-defined]


def _circle(pilot: Autopilot, item: Item) -> CircleManoeuvre:
    return CircleManoeuvre(*place_of_item(pilot, item), item.p3 or pilot.circle_radius)  # type: ignore[attr-defined]


def _to_height(pilot: Autopilot, item: Item) -> CircleManoeuvre:
    return CircleManoeuvre(*place_of_item(pilot, item), item.p2 or pilot.circle_radius)  # type: ignore[attr-defined]


class _Stay(CircleManoeuvre):
    """A circle that is never done."""

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the motion on the circle."""
        wanted = super().aim(pilot)
        self.done = False
        return wanted


def _stay(pilot: Autopilot, item: Item) -> Manoeuvre:
    return _Stay(*place_of_item(pilot, item), item.p3 or pilot.circle_radius)  # type: ignore[attr-defined]


class _CircleTurns(CircleManoeuvre):
    """A circle that is done after its turns."""

    def __init__(self, pilot: Autopilot, item: Item) -> None:
        super().__init__(*place_of_item(pilot, item), item.p3 or pilot.circle_radius)  # type: ignore[attr-defined]
        self._left = math.tau * item.p1
        self._seen: float | None = None

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the motion on the circle, counting the turns once it is there."""
        wanted = super().aim(pilot)
        seen = math.atan2(pilot.body.east - self.east, pilot.body.north - self.north)
        if self.done or self._seen is not None:
            self._left -= abs(math.remainder(seen - (seen if self._seen is None else self._seen), math.tau))
            self._seen = seen
        self.done = self._left <= 0.0
        return wanted


def _land(pilot: Autopilot, item: Item) -> Manoeuvre:
    north, east, _ = place_of_item(pilot, item)
    return LandingApproach(north, east)


def _take_off(pilot: Autopilot, item: Item) -> Manoeuvre:
    return RunwayTakeoff(place_of_item(pilot, item)[2])


class WingedMission(MissionManoeuvre):
    """Fly the items from the current one on; begins with a circle at the present position."""

    manoeuvres: ClassVar[Mapping[int, Callable[[Autopilot, Item], Manoeuvre]]] = {
        mav.MAV_CMD_NAV_WAYPOINT: _pass,
        mav.MAV_CMD_NAV_LOITER_UNLIM: _stay,
        mav.MAV_CMD_NAV_LOITER_TURNS: _CircleTurns,
        mav.MAV_CMD_NAV_LOITER_TIME: _circle,
        mav.MAV_CMD_NAV_LOITER_TO_ALT: _to_height,
        mav.MAV_CMD_NAV_LAND: _land,
        mav.MAV_CMD_NAV_TAKEOFF: _take_off,
    }
