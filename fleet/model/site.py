"""The frame that the robots of one edge share: where each one's own world lies in it; pure.

The site's frame is east-north-up around ``site.origin`` of fleet.yaml, in metres. A robot that knows where
on Earth its world's origin is (``origin:``, or its home) is placed by that; another by where it stood when
it was heard first (``start:``).
"""

from __future__ import annotations

import math

import msgspec

from fleet.model.geodesy import GeoOrigin, geo_from_world, world_from_geo
from fleet.model.geometry import Pose, Vector3, rotate_to_world, wrap_angle

_FAR = Vector3(100.0)  # m along +x: far enough that its direction is exact


class Placement(msgspec.Struct, frozen=True):
    """A robot's world in the site's frame: its origin (m), and how its +x is turned (rad, ccw from east)."""

    origin: Vector3 = Vector3()
    yaw: float = 0.0

    def to_site(self, point: Vector3) -> Vector3:
        """Return a point of the robot's world in the site's frame."""
        return self.origin + rotate_to_world(point, self.yaw)

    def to_world(self, point: Vector3) -> Vector3:
        """Return a point of the site's frame in the robot's world."""
        return rotate_to_world(point - self.origin, -self.yaw)


def placed_on_earth(site: GeoOrigin, world: GeoOrigin) -> Placement:
    """Return where the world of a robot lies whose place on Earth is known.

    Exact at its origin; within 0.3 m some kilometres around it.
    """
    origin = world_from_geo(site, geo_from_world(world, Vector3()))
    along = world_from_geo(site, geo_from_world(world, _FAR)) - origin
    return Placement(origin, math.atan2(along.y, along.x))


def placed_at_start(start: tuple[float, float, float], pose: Pose) -> Placement:
    """Return where the world of a robot lies that is at ``start`` (x, y, m; heading, rad) and tells ``pose``.

    Its odometry need not begin at nought: a heading from a compass does not. Its ground is the site's.
    """
    x, y, heading = start
    yaw = wrap_angle(heading - pose.rotation.yaw)
    gone = rotate_to_world(Vector3(pose.position.x, pose.position.y), yaw)
    return Placement(Vector3(x, y) - gone, yaw)
