"""Fence in a simulated autopilot's memory: its vertices, and the check of a position."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from fleet import Polygon, polygon_contains
from fleet_mavlink.sim.mission_items import FENCE, Item

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


def is_outside(
    pilot: Autopilot, place: tuple[float, float, float], *, kinds: int, height: float, radius: float
) -> bool:
    """Return True if a local position (NED) is out of bounds; a height or radius of 0 is no bound."""
    north, east, down = place
    home_north, home_east, home_down = pilot.home_ned()
    over = kinds & HEIGHT and height > 0 and home_down - down > height
    away = kinds & CIRCLE and radius > 0 and math.hypot(north - home_north, east - home_east) > radius
    if over or away or not kinds & POLYGON:
        return bool(over or away)
    inclusions = list(polygons(pilot, _INSIDE))
    inside = not inclusions or any(polygon_contains(each, (north, east)) for each in inclusions)
    return not inside or any(polygon_contains(each, (north, east)) for each in polygons(pilot, _OUTSIDE))
