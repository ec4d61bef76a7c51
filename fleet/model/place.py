"""Named places: points or areas to which robots are sent and which missions occupy; pure.

A place is defined in the site's frame (metres, east-north-up) or on Earth (degrees, heights in metres above
the take-off point, as in goals on Earth).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import msgspec

from fleet.model.geodesy import GeoOrigin, GeoPoint, world_from_geo
from fleet.model.geometry import Vector3
from fleet.model.polygon import Polygon, PolygonPoint, centroid, polygon_contains

PlaceKind = Literal["dock", "pad", "door", "area"]
PlaceFrame = Literal["site", "geodetic"]


class Place(msgspec.Struct, frozen=True, omit_defaults=True):
    """A place: the point ``at`` (two or three numbers) where robots are sent, and its ``capacity`` in robots.

    ``frame`` is that of ``at`` and ``polygon``: metres in the site's frame, or latitude and longitude.
    ``heading`` is that of a robot at the place, radians counter-clockwise from east. ``radius`` (m) or
    ``polygon`` is its extent, ``height`` (m) its range of heights above the ground.
    """

    name: str
    at: tuple[float, ...]
    frame: PlaceFrame = "site"
    kind: PlaceKind = "area"
    heading: float | None = None
    radius: float | None = None
    polygon: Polygon = ()
    height: tuple[float, float] | None = None
    capacity: int = 1

    def trouble(self, steps: Iterable[Vector3]) -> str:
        """Return why robots cannot stand at ``steps`` (m, from the place's point); empty when they can."""
        spots = list(steps)
        if len(spots) > self.capacity:
            return f"{self.name} has room for {self.capacity}, these are {len(spots)}"
        if all(self._reaches(spot) for spot in spots):
            return ""
        return f"they do not fit into {self.name} so far from each other"

    def _reaches(self, step: Vector3) -> bool:
        """Return whether the place contains the point at this offset from its own point."""
        if step.horizontal() == 0.0:
            return True
        if self.radius is not None and step.horizontal() > self.radius:
            return False
        return not self.polygon or polygon_contains(self._around(), (step.x, step.y))

    def _around(self) -> Polygon:
        """Return the polygon in metres relative to the place's point."""
        if self.frame == "geodetic":
            return metric(self.polygon, GeoOrigin(self.at[0], self.at[1]))
        return tuple((x - self.at[0], y - self.at[1]) for x, y in self.polygon)


def point_of(polygon: Polygon, height: tuple[float, float] | None) -> tuple[float, ...]:
    """Return the point where robots are sent within an area: its centroid, half-way up.

    Empty when the centroid is outside the area, as in the bend of an L.
    """
    middle = centroid(polygon)
    if not polygon_contains(polygon, middle):
        return ()
    return middle if height is None else (*middle, (height[0] + height[1]) / 2)


def metric(polygon: Polygon, origin: GeoOrigin) -> Polygon:
    """Return a polygon of latitudes and longitudes in metres of the world around ``origin``."""
    corners = (world_from_geo(origin, GeoPoint(*corner, origin.altitude)) for corner in polygon)
    return tuple((corner.x, corner.y) for corner in corners)


def is_allowed_point(point: PolygonPoint, inclusion: Iterable[Polygon], exclusion: Iterable[Polygon]) -> bool:
    """Return whether a fence of these polygons allows a point; without inclusions all points are inside."""
    allowed = tuple(inclusion)
    inside = not allowed or any(polygon_contains(polygon, point) for polygon in allowed)
    return inside and not any(polygon_contains(polygon, point) for polygon in exclusion)
