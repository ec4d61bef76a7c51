"""Fence of one robot: places its corners in the robot's world, and judges positions and velocities.

The configuration has the corners; home and the origin of the robot's world place them.
"""

from __future__ import annotations

from collections.abc import Iterable

from fleet.errors import Refused
from fleet.host.robot.robot_place import RobotPlace
from fleet.host.safety.fence import Fence
from fleet.model.geodesy import GeoOrigin, GeoPoint, world_from_geo
from fleet.model.geometry import Vector3, Velocity
from fleet.model.polygon import Polygon
from fleet.robot_config import FenceConfig, Limits


class FenceKeeper:
    """The ``fence`` of one robot, None while its corners cannot be placed.

    ``trouble`` describes a forbidden position of the robot; empty while its position is allowed.
    """

    def __init__(self, place: RobotPlace, config: FenceConfig | None, limits: Limits) -> None:
        self._place = place
        self.fence: Fence | None = None
        self.trouble = ""
        self.configure(config, limits)

    def configure(self, config: FenceConfig | None, limits: Limits) -> None:
        """Apply a changed fence and changed limits."""
        self._config, self._limits = config, limits
        self._has_border = config is not None or limits.distance is not None
        self.is_open = not self._has_border and limits.altitude is None
        if self.is_open:
            self.trouble = ""  # nothing would clear it, since positions are no longer judged
        self.draw()

    def draw(self) -> None:
        """Place the configured fence, once that is possible."""
        config = self._config or FenceConfig()
        world = self._place.world()
        if config.frame == "geodetic" and world is None:
            self.fence = None
            return
        self.fence = Fence(
            tuple(_placed(corners, config, world) for corners in config.inclusion),
            tuple(_placed(corners, config, world) for corners in config.exclusion),
            self._limits.altitude,
            self._limits.distance,
            config.margin,
        )

    def check(self) -> bool:
        """Judge the robot's position; return True only when it has just breached the fence."""
        pose = self._place.pose
        if self.is_open or self.fence is None or pose is None:
            return False
        before, self.trouble = self.trouble, self.fence.breach(pose.position, self._place.home_point())
        return bool(self.trouble) and not before

    @property
    def breached(self) -> str:
        """Why the robot may be outside now, as text; empty while it is known to be inside."""
        if self.trouble:
            return f"it is {self.trouble}"
        unknown = self._place.fresh() is None or self.fence is None
        return "its position is unknown, so its fence cannot be kept" if unknown and self._has_border else ""

    def route_trouble(self, start: Vector3, points: Iterable[Vector3], around: Iterable[float] = ()) -> str:
        """Return why the robot may not go from a point through others; empty when it may."""
        return self.fence.route_trouble(start, points, self._place.home_point(), around) if self.fence else ""

    def would_leave(self, velocity: Velocity) -> bool:
        """Return whether a body velocity leads out of the fence, or may, because the pose is too old."""
        if self.fence is None or self._place.pose is None:
            return False
        try:
            return self.inside(velocity) != velocity
        except Refused:
            return True

    def inside(self, velocity: Velocity) -> Velocity:
        """Return the part of a body velocity that stays in the fence; raises Refused if that is unknown."""
        if self.is_open or (velocity.is_zero if self._has_border else velocity.linear.z <= 0):
            return velocity
        pose = self._place.fresh()
        if pose is None or self.fence is None:
            if not self._has_border:
                return velocity
            raise Refused("the fence cannot be kept: the robot's position is unknown")
        heading = pose.rotation.yaw if self._has_border else 0.0  # a ceiling limits the climb of any
        admitted = self.fence.admitted(pose.position, velocity.linear, self._place.home_point(), heading)
        return velocity if admitted == velocity.linear else Velocity(admitted, velocity.yaw_rate)


def _placed(corners: Iterable[tuple[float, float]], config: FenceConfig, world: GeoOrigin | None) -> Polygon:
    """Return the corners of a polygon in the robot's world."""
    if config.frame == "world" or world is None:
        return tuple(corners)
    points = [world_from_geo(world, GeoPoint(*corner, world.altitude)) for corner in corners]
    return tuple((point.x, point.y) for point in points)
