"""fleet.yaml's ``places``: named points and areas, checked against the robots' fences."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Self

from pydantic import Field, model_validator

from fleet.config.yaml import Document
from fleet.model.geodesy import GeoOrigin, GeoPoint, geo_from_world, world_from_geo
from fleet.model.geometry import Vector3
from fleet.model.place import Place, PlaceFrame, PlaceKind, is_allowed_point, metric, point_of
from fleet.model.polygon import PolygonPoint, polygon_contains
from fleet.robot_config import AdapterConfig, Corners, FenceConfig, Name, Positive
from fleet.runtime.decoding import convert_strictly
from fleet.yaml_model import Model, wrong

Site = tuple[float, float, float]
At = Annotated[tuple[float, ...], Field(min_length=2, max_length=3)]


class PlaceConfig(Model):
    """A named place: a point or an area. Robots are sent there by its name, missions occupy it."""

    kind: PlaceKind = Field("area", description="Its kind.")
    frame: PlaceFrame = Field(
        "site",
        description="Frame of its numbers: metres east and north in the site's frame, or latitude and "
        "longitude in degrees.",
    )
    at: At | None = Field(
        None,
        description="Where robots are sent: [x, y] or [x, y, z]; with frame: geodetic [latitude, longitude] "
        "or with metres above the take-off point. Left out: the middle of its polygon. An aircraft needs the "
        "height.",
    )
    heading: float | None = Field(
        None,
        ge=-6.2832,
        le=6.2832,
        description="Heading of a robot there, radians counter-clockwise from east.",
    )
    radius: Positive | None = Field(None, description="Radius of a point, m.")
    polygon: Corners | None = Field(None, description="3 to 100 corners, as in [[0, 0], [2, 0], [2, 1]].")
    height: tuple[float, float] | None = Field(
        None, description="[lowest, highest] of its polygon, metres above the ground."
    )
    capacity: int = Field(1, ge=1, le=1000, description="How many robots, or missions, may have it at once.")

    @model_validator(mode="after")
    def _checked_position(self) -> Self:
        """Refuse a place without a position, and one with two definitions of its extent."""
        if self.at is None and self.polygon is None:
            raise wrong("at", "where is it? at: [x, y], or a polygon")
        if self.polygon is not None and self.radius is not None:
            raise wrong("radius", "the polygon says already how far it reaches; leave one of the two out")
        if self.height is not None and (self.polygon is None or self.height[0] > self.height[1]):
            raise wrong("height", "is [lowest, highest] of a polygon")
        return self

    @model_validator(mode="after")
    def _pointed(self) -> Self:
        """Refuse an area whose point is outside, and invalid degrees."""
        corners = (*(self.polygon or ()), *(() if self.at is None else ((self.at[0], self.at[1]),)))
        if self.frame == "geodetic" and any(abs(lat) >= 89 or abs(lon) > 180 for lat, lon in corners):
            key = "at" if self.at is not None else "polygon"
            raise wrong(key, "geodetic numbers are [latitude, longitude] in degrees")
        if self.polygon is None:
            return self
        if self.at is not None and not polygon_contains(self.polygon, (self.at[0], self.at[1])):
            raise wrong("at", "lies outside the polygon")
        if self.at is None and not point_of(self.polygon, self.height):
            raise wrong("polygon", "its middle lies outside of it: say at:, where robots are sent")
        return self

    def place(self, name: str) -> Place:
        """Return the place in the form used by the other modules."""
        corners = self.polygon or ()
        return Place(
            name,
            self.at or point_of(corners, self.height),
            self.frame,
            self.kind,
            self.heading,
            self.radius,
            corners,
            self.height,
            self.capacity,
        )


def places_of(configs: Mapping[Name, PlaceConfig]) -> dict[str, Place]:
    """Return the places of a fleet file by name."""
    return {name: config.place(name) for name, config in configs.items()}


def check_places(
    places: Mapping[Name, PlaceConfig], robots: Iterable[AdapterConfig], site: Site | None, document: Document
) -> None:
    """Report places outside the fences of all robots; warn of those outside the fences of some.

    A fence in a world frame that is placed only by the robot's home or start is not checked before the run.
    """
    all_robots = list(robots)
    for name, config in places.items():
        allowed = {robot.name: is_allowed(robot, config.place(name), site) for robot in all_robots}
        out = sorted(robot for robot, may in allowed.items() if may is False)
        if not out:
            continue
        mark, message = document.marks["places", name], f"it is outside the fence of {', '.join(out)}"
        if len(out) == len(all_robots):
            document.report(mark, f"{message}: no robot can be sent there", "move it, or widen a fence")
        else:
            document.warn(mark, message, "they will refuse to go there")


def is_allowed(robot: AdapterConfig, place: Place, site: Site | None) -> bool | None:
    """Return True if a robot's fence contains the point of a place; None if that is unknown."""
    fence = robot.fence
    on_earth = _on_earth(place, site)
    if fence is None or on_earth is None:
        return None
    if fence.frame == "geodetic":
        return _within(fence, (0.0, 0.0), GeoOrigin(on_earth.latitude, on_earth.longitude))
    if robot.origin is None:
        return None
    point = world_from_geo(convert_strictly(robot.origin, GeoOrigin, from_attributes=True), on_earth)
    return _within(fence, (point.x, point.y), None)


def _on_earth(place: Place, site: Site | None) -> GeoPoint | None:
    """Return the point of a place on Earth; None if the site has no origin."""
    if place.frame == "geodetic":
        return GeoPoint(place.at[0], place.at[1])
    if site is None:
        return None
    return geo_from_world(GeoOrigin(*site), Vector3(place.at[0], place.at[1]))


def _within(fence: FenceConfig, point: PolygonPoint, around: GeoOrigin | None) -> bool:
    """Return True if a point is inside a fence with corners in metres, or in degrees ``around`` a place."""
    inclusion, exclusion = fence.inclusion, fence.exclusion
    if around is not None:
        inclusion = tuple(metric(polygon, around) for polygon in inclusion)
        exclusion = tuple(metric(polygon, around) for polygon in exclusion)
    return is_allowed_point(point, inclusion, exclusion)
