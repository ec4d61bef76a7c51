"""The local frame (NED) of a simulated estimator, and places on Earth."""

from __future__ import annotations

from fleet import GeoOrigin, GeoPoint, Vector3, geo_from_world, world_from_geo

Geo = tuple[float, float, float]  # degrees, degrees, metres above mean sea level
Ned = tuple[float, float, float]  # metres north, east, down


class LocalFrame:
    """A frame with its origin at ``place``; ``altitude_error``: m that altitudes are estimated too high."""

    def __init__(self, place: Geo) -> None:
        self.altitude_error = 0.0
        self._place = place
        self._origin = GeoOrigin(*place)

    def ned_of(self, latitude: float, longitude: float, altitude: float) -> Ned:
        """Return the local position of a place on Earth (altitude above mean sea level)."""
        enu = world_from_geo(self._origin, GeoPoint(latitude, longitude, altitude - self.altitude_error))
        return enu.y, enu.x, -enu.z

    def geo_of(self, place: Ned) -> Geo:
        """Return a local position as a place on Earth."""
        north, east, down = place
        point = geo_from_world(self._origin, Vector3(east, north, -down))
        return point.latitude, point.longitude, point.altitude + self.altitude_error

    def down_of(self, altitude: float) -> float:
        """Return an estimated altitude (m above mean sea level) as a local position."""
        return self._place[2] + self.altitude_error - altitude
