"""Checks the paths of a run against each robot's fence and limits, before anything moves."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from fleet.config.load import Loaded
from fleet.config.places import places_of
from fleet.errors import Refused
from fleet.host.safety.fence import Fence
from fleet.missions.points import SiteMap
from fleet.missions.program import Act
from fleet.model.geodesy import GeoOrigin, GeoPoint, world_from_geo
from fleet.model.geometry import Vector3
from fleet.model.polygon import Polygon
from fleet.model.site import Placement
from fleet.model.state import RobotState
from fleet.robot_config import AdapterConfig, FenceConfig, Limits


class RobotRouteCheck(msgspec.Struct, frozen=True):
    """Checks the acts of one robot. A robot of the site is placed by then; its home is its origin."""

    config: AdapterConfig
    site: SiteMap

    def trouble(self, act: Act, state: RobotState) -> str:
        """Return why a robot must not do something; empty when no reason is known."""
        try:
            if act.verb == "goto":
                return self._route([act.value], state)
            if act.verb == "path":
                return self._route(act.value, state)
        except Refused as error:
            return error.reason
        highest, altitude = self.config.limits.altitude, act.data.get("altitude")
        too_high = highest is not None and isinstance(altitude, int | float) and altitude > highest
        if act.value == "takeoff" and too_high:
            return f"{altitude:g} m above home, the limit is {highest:g} m"
        return ""

    def _route(self, points: list[object], state: RobotState) -> str:
        """Return the conflict of a path; raises Refused for a point that cannot be converted."""
        for point in points:
            self.site.position(point, state)
        fence = self._fence(state.placement) if state.placement is not None else None
        if fence is None or state.placement is None:
            return ""
        route = [self._in_world(point, state.placement, state) for point in points]
        return fence.route_trouble(route[0], route, Vector3())

    def _in_world(self, value: object, placement: Placement, state: RobotState) -> Vector3:
        """Return a point in the robot's world; a missing height is the robot's own."""
        point, height = self.site.site_point(value), self.site.height(value)
        z = point[2] if len(point) > 2 else state.site.z if state.site is not None else 0.0
        world = placement.to_world(Vector3(point[0], point[1], z))
        return world if height is None else Vector3(world.x, world.y, height)

    def _fence(self, placement: Placement) -> Fence | None:
        """Return the fence in the robot's world; None while it cannot be placed."""
        config, limits = self.config.fence or FenceConfig(), self.config.limits
        origin = self.site.origin
        if config.frame == "geodetic" and origin is None:
            return None
        if self.config.origin is not None:
            limits = Limits()  # they are relative to its home, which is not its origin
        inclusion, exclusion = (
            tuple(_placed(polygon, config, origin, placement) for polygon in polygons)
            for polygons in (config.inclusion, config.exclusion)
        )
        return Fence(inclusion, exclusion, limits.altitude, limits.distance, config.margin)


def _placed(polygon: Polygon, config: FenceConfig, origin: GeoOrigin | None, placement: Placement) -> Polygon:
    """Return the corners of a polygon in the robot's world."""
    if config.frame == "world" or origin is None:
        return polygon
    corners = [world_from_geo(origin, GeoPoint(*corner, origin.altitude)) for corner in polygon]
    return tuple((corner.x, corner.y) for corner in map(placement.to_world, corners))


class MissionRoutes:
    """Path checks of an edge's robots; other edges check theirs. ``state_of`` returns a robot's state."""

    def __init__(self, loaded: Loaded, state_of: Callable[[str], RobotState]) -> None:
        self.state_of = state_of
        self.configure(loaded)

    def configure(self, loaded: Loaded) -> None:
        """Use the places and robots of another configuration."""
        origin = loaded.config.site.origin
        self.site = SiteMap(
            places_of(loaded.config.places), GeoOrigin(*origin) if origin is not None else None
        )
        self._checks = {robot.name: RobotRouteCheck(robot, self.site) for robot, _ in loaded.robots}

    def join(self, robot: AdapterConfig) -> None:
        """Add a robot."""
        self._checks[robot.name] = RobotRouteCheck(robot, self.site)

    def leave(self, name: str) -> None:
        """Remove a robot."""
        self._checks.pop(name, None)

    def blocker(self, robot: str, act: Act) -> str:
        """Return why a robot must not do something; empty when no reason is known."""
        check = self._checks.get(robot)
        for each in (robot, act.value) if act.verb == "follow" else ():
            if each not in self._checks:
                return f"{each} is a robot of another edge: one follows another of its own edge only"
        return check.trouble(act, self.state_of(robot)) if check is not None else ""
