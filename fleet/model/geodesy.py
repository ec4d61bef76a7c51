"""Conversion between latitude/longitude and the flat world frame around a declared origin.

WGS-84. Horizontally the plane tangent to the ellipsoid at the origin, exact at the origin's altitude.
Vertically the difference of altitudes, not the height above the plane, so that level flight stays level.
Not valid near the poles.
"""

from __future__ import annotations

import math

import msgspec

from fleet.model.geometry import Vector3

EQUATORIAL_RADIUS = 6_378_137.0  # m, WGS-84 a
FLATTENING = 1 / 298.257223563  # WGS-84 f
ECCENTRICITY_SQUARED = FLATTENING * (2 - FLATTENING)

# Corrections of geo_from_world: within 10 km each leaves less than a hundredth of the error.
_CORRECTIONS = 6  # at most
_EXACT = 1e-6  # m of error, after whose correction no other is needed


class GeoPoint(msgspec.Struct, frozen=True):
    """A position on Earth: degrees, and metres above mean sea level."""

    latitude: float
    longitude: float
    altitude: float = 0.0


class GeoOrigin(msgspec.Struct, frozen=True):
    """Origin of the world frame on Earth; ``heading`` is the compass heading of +y in degrees."""

    latitude: float
    longitude: float
    altitude: float = 0.0
    heading: float = 0.0


def _from_axis_and_equator(latitude: float, altitude: float) -> tuple[float, float]:
    """Return the distance from the Earth's axis and from the equator's plane, m; ``latitude`` in radians."""
    sin, cos = math.sin(latitude), math.cos(latitude)
    across = EQUATORIAL_RADIUS / math.sqrt(1 - ECCENTRICITY_SQUARED * sin * sin)
    return (across + altitude) * cos, (across * (1 - ECCENTRICITY_SQUARED) + altitude) * sin


def _east_north(origin: GeoOrigin, latitude: float, longitude: float) -> tuple[float, float]:
    """Return metres east and north in the origin's tangent plane; latitude and longitude in degrees."""
    here = math.radians(origin.latitude)
    turn = math.radians(math.remainder(longitude - origin.longitude, 360.0))
    axis_here, equator_here = _from_axis_and_equator(here, origin.altitude)
    axis, equator = _from_axis_and_equator(math.radians(latitude), origin.altitude)
    outward, upward = axis * math.cos(turn) - axis_here, equator - equator_here
    return axis * math.sin(turn), math.cos(here) * upward - math.sin(here) * outward


def _radii(origin: GeoOrigin) -> tuple[float, float]:
    """Return the radii of curvature of the meridian and of the parallel at the origin, m."""
    here = math.radians(origin.latitude)
    root = math.sqrt(1 - ECCENTRICITY_SQUARED * math.sin(here) ** 2)
    meridian = EQUATORIAL_RADIUS * (1 - ECCENTRICITY_SQUARED) / root**3 + origin.altitude
    return meridian, (EQUATORIAL_RADIUS / root + origin.altitude) * math.cos(here)


def _turned(vector: Vector3, degrees: float) -> Vector3:
    """Rotate a vector about z by ``degrees``, counter-clockwise."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return Vector3(cos * vector.x - sin * vector.y, sin * vector.x + cos * vector.y, vector.z)


def world_from_geo(origin: GeoOrigin, point: GeoPoint) -> Vector3:
    """Return ``point`` in the world frame of ``origin``, metres."""
    east, north = _east_north(origin, point.latitude, point.longitude)
    return _turned(Vector3(east, north, point.altitude - origin.altitude), origin.heading)


def geo_from_world(origin: GeoOrigin, position: Vector3) -> GeoPoint:
    """Return the position on Earth of a point in the world frame of ``origin`` (metres)."""
    # No closed form for the inverse: start at the origin and correct by the error that is left.
    enu = _turned(position, -origin.heading)
    meridian, parallel = _radii(origin)
    latitude, longitude = origin.latitude, origin.longitude
    east_left, north_left = enu.x, enu.y
    for _ in range(_CORRECTIONS):
        latitude += math.degrees(north_left / meridian)
        longitude += math.degrees(east_left / parallel)
        if math.hypot(east_left, north_left) < _EXACT:
            break
        east, north = _east_north(origin, latitude, longitude)
        east_left, north_left = enu.x - east, enu.y - north
    return GeoPoint(latitude, math.remainder(longitude, 360.0), origin.altitude + enu.z)
