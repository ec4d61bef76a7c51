"""Fence in a simulated autopilot's memory: its vertices, and the check of a position."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

from fleet import Polygon, polygon_contains
from fleet_mavlink.sim.local_frame import Ned
from fleet_mavlink.sim.mission_items import FENCE, Item
from fleet_mavlink.sim.params import Params

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot

_INSIDE, _OUTSIDE = 5001, 5002
HEIGHT, CIRCLE, POLYGON = 1, 2, 4  # bits of the checked bounds


def polygons(pilot: Autopilot, command: int) -> Iterator[Polygon]:
    """Yield the stored polygons of one kind as local positions (north, east)."""
    corners: list[tuple[float, float]] = []
    for item in pilot.missions.plan(FENCE):
        if item.command != command:
            continue
        corners.append(_corner(pilot, item))
        if len(corners) == int(item.p1):
            yield tuple(corners)
            corners = []


def _corner(pilot: Autopilot, item: Item) -> tuple[float, float]:
    """Return one corner as a local position."""
    north, east, _ = pilot.frame.ned_of(item.x / 1e7, item.y / 1e7, pilot.place[2])
    return north, east


class FenceBounds(NamedTuple):
    """Bounds of a fence: the ``kinds`` that are checked, and metres above and around home; 0 is no bound."""

    kinds: int
    height: float
    radius: float


class FenceMonitor:
    """The fence of one vehicle; ``bounds`` returns those that its parameters switch on, None for no fence."""

    def __init__(self, pilot: Autopilot, bounds: Callable[[Params], FenceBounds | None]) -> None:
        self._pilot = pilot
        self._bounds = bounds
        self._broken = False

    def is_outside(self, place: Ned) -> bool:
        """Return True if a local position is outside the fence that is switched on."""
        bounds = self._bounds(self._pilot.params)
        return bounds is not None and _is_outside(self._pilot, place, bounds)

    def watch(self, breach: Callable[[], None]) -> None:
        """Call ``breach`` once when the flying vehicle leaves the fence."""
        body = self._pilot.body
        outside = self.is_outside((body.north, body.east, body.down))
        if outside and not self._broken:
            breach()
        self._broken = outside


def _is_outside(pilot: Autopilot, place: Ned, bounds: FenceBounds) -> bool:
    """Return True if a local position is out of bounds."""
    north, east, down = place
    kinds, height, radius = bounds.kinds, bounds.height, bounds.radius
    over, away = kinds & HEIGHT and height > 0, kinds & CIRCLE and radius > 0
    if over or away:
        home_north, home_east, home_down = pilot.home.ned()
        over = over and home_down - down > height
        away = away and math.hypot(north - home_north, east - home_east) > radius
    if over or away or not kinds & POLYGON:
        return bool(over or away)
    inclusions = list(polygons(pilot, _INSIDE))
    inside = not inclusions or any(polygon_contains(each, (north, east)) for each in inclusions)
    return not inside or any(polygon_contains(each, (north, east)) for each in polygons(pilot, _OUTSIDE))
