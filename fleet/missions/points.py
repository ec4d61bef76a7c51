"""Points of a mission: in the site's frame, on Earth, or a named place; pure.

``[x, y]`` or ``[x, y, z]`` are metres in the site's frame. ``{lat, lon, alt}`` are degrees, and metres above
the take-off point; a ground robot ignores the height.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import msgspec

from fleet.errors import Refused
from fleet.model.geodesy import GeoOrigin, GeoPoint, world_from_geo
from fleet.model.geometry import Vector3
from fleet.model.place import Place
from fleet.model.state import RobotState

MOST_POINTS = 500  # of one path, the limit of robots
_GEO = ("lat", "lon", "alt")
_SHAPE = "a point is [x, y] or [x, y, z] in metres, or {lat, lon, alt} in degrees and metres"


class SiteMap(msgspec.Struct, frozen=True):
    """Context of points: the places of fleet.yaml, and the site's origin on Earth (None: unknown)."""

    places: Mapping[str, Place] = {}
    origin: GeoOrigin | None = None

    def site_point(self, value: Any) -> tuple[float, ...]:
        """Return a point in the site's frame: x, y and, if defined there, z in m; raises Refused.

        The height of a point on Earth is relative to the take-off point, so it gives no z in the site's
        frame.
        """
        earth = self._on_earth(value)
        if earth is None:
            place = self.places.get(value) if isinstance(value, str) else None
            return tuple(place.at if place is not None else value)
        if self.origin is None:
            raise Refused("the site's position on Earth is unknown: site: {origin: ...} in fleet.yaml")
        point = world_from_geo(self.origin, GeoPoint(earth[0], earth[1], self.origin.altitude))
        return point.x, point.y

    def height(self, value: Any) -> float | None:
        """Return the height of a point on Earth in m above the take-off point; None for any other point."""
        earth = self._on_earth(value)
        return earth[2] if earth is not None and len(earth) > 2 else None

    def position(self, value: Any, robot: RobotState) -> dict[str, Any]:
        """Return a point in the form for a robot, in its own world frame or on Earth; raises Refused.

        A missing height is the robot's present height.
        """
        earth, flies = self._on_earth(value), robot.armed is not None
        if earth is not None and len(earth) > 2 and flies:
            return {"geodetic_position": dict(zip(("latitude", "longitude", "altitude"), earth, strict=True))}
        point = self.site_point(value)
        if robot.placement is None:
            raise Refused(f"{robot.name} is not placed in the site's frame: site: and start: in fleet.yaml")
        here = robot.site.z if robot.site is not None else 0.0
        x, y, z = (*point, here) if len(point) == 2 else point
        world = robot.placement.to_world(Vector3(x, y, z))
        return {"position": [world.x, world.y, world.z][: 3 if flies else len(point)]}

    def _on_earth(self, value: Any) -> tuple[float, ...] | None:
        """Return latitude, longitude and, if given, height of a point on Earth; None for other points."""
        if isinstance(value, dict):
            return tuple(value[key] for key in _GEO if key in value)
        if not isinstance(value, str):
            return None
        place = self.places.get(value)
        if place is None:
            raise Refused(f"there is no place {value!r}")
        return place.at if place.frame == "geodetic" else None


def point_trouble(value: object) -> str:
    """Return why a value is no valid point; empty if it is one."""
    if isinstance(value, list):
        fits = 2 <= len(value) <= 3 and all(map(_is_number, value))
        return "" if fits else _SHAPE
    if not isinstance(value, dict):
        return _SHAPE
    if not {"lat", "lon"} <= value.keys() <= set(_GEO) or not all(map(_is_number, value.values())):
        return _SHAPE
    on_earth = abs(value["lat"]) < 89 and abs(value["lon"]) <= 180
    return "" if on_earth else "lat and lon are degrees, -89 to 89 and -180 to 180"


def is_point(value: object) -> bool:
    """Return True if a value is one point, not a list of points or files."""
    return isinstance(value, dict) or (isinstance(value, list) and all(map(_is_number, value)))


def _is_number(value: object) -> bool:
    """Return True for a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
