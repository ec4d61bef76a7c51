"""The site frame, which the robots of one edge share, and the placement of each robot's world in it; pure.

The site frame is east-north-up around ``site.origin`` of fleet.yaml, in metres. A robot whose world origin
on Earth is known (``origin:``, or its home) is placed by that; any other by its declared position at its
first pose report (``start:``).
"""

from __future__ import annotations

import math

import msgspec

from fleet.model.geodesy import GeoOrigin, geo_from_world, world_from_geo
from fleet.model.geometry import Pose, Vector3, rotate_to_world, wrap_angle

_FAR = Vector3(100.0)  # m along +x: far enough that rounding does not affect the direction


class Placement(msgspec.Struct, frozen=True):
    """Pose of a robot's world frame in the site frame: origin (m), direction of +x (rad, ccw from east)."""

    origin: Vector3 = Vector3()
    yaw: float = 0.0

    def to_site(self, point: Vector3) -> Vector3:
        """Convert a point from the robot's world to the site frame (m)."""
        return self.origin + rotate_to_world(point, self.yaw)

    def to_world(self, point: Vector3) -> Vector3:
        """Convert a point from the site frame to the robot's world (m)."""
        return rotate_to_world(point - self.origin, -self.yaw)


def placed_on_earth(site: GeoOrigin, world: GeoOrigin) -> Placement:
    """Return the placement of a robot whose world origin on Earth is known.

    Exact at that origin; within 0.3 m some kilometres around it.
    """
    origin = world_from_geo(site, geo_from_world(world, Vector3()))
    along = world_from_geo(site, geo_from_world(world, _FAR)) - origin
    return Placement(origin, math.atan2(along.y, along.x))


def placed_at_start(start: tuple[float, float, float], pose: Pose) -> Placement:
    """Return the placement of a robot that stands at ``start`` (x, y, m; heading, rad) and reports ``pose``.

    Its odometry need not start at zero: a compass heading does not. Its z = 0 is that of the site.
    """
    x, y, heading = start
    yaw = wrap_angle(heading - pose.rotation.yaw)
    gone = rotate_to_world(Vector3(pose.position.x, pose.position.y), yaw)
    return Placement(Vector3(x, y) - gone, yaw)
