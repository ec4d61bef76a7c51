"""Position of one robot, and the points of its tasks: pose, home and the origin of its world.

All points are in the robot's own world frame, metres, z up.
"""

from __future__ import annotations

from collections.abc import Iterable

from fleet.clock import Clock
from fleet.errors import Refused
from fleet.model.geodesy import GeoOrigin, GeoPoint, world_from_geo
from fleet.model.geometry import Pose, Vector3, rotate_to_world
from fleet.model.navigation import AnyTask, FlyMission, FollowPath, FollowRobot, Goal, GoTo
from fleet.robot_config import WorldOrigin
from fleet.runtime.decoding import convert_strictly

STALE = 1.0  # s after which a pose is too old for the fence
POSITION_UNKNOWN = (
    "the robot's position is unknown: its fence, battery and separation cannot be kept; "
    "try again once it reports one"
)
"""Refusal of a task or a climb. An aircraft that starts up has no position yet."""


class RobotPlace:
    """Place of one robot; ``origin`` is that of fleet.yaml, None where home is the origin."""

    def __init__(self, origin: WorldOrigin | None, clock: Clock) -> None:
        self._clock = clock
        self._origin = None if origin is None else convert_strictly(origin, GeoOrigin, from_attributes=True)
        self.home: GeoPoint | None = None
        self.pose: Pose | None = None
        self._seen = 0.0

    def observe(self, pose: Pose) -> None:
        """Record the newest pose."""
        self.pose = pose
        self._seen = self._clock.monotonic()

    def fresh(self) -> Pose | None:
        """Return the pose; None when it is too old."""
        return self.pose if self._clock.monotonic() - self._seen <= STALE else None

    def world(self) -> GeoOrigin | None:
        """Return the world's origin: the one of fleet.yaml, else home."""
        if self._origin is not None or self.home is None:
            return self._origin
        return GeoOrigin(self.home.latitude, self.home.longitude, self.home.altitude)

    def home_point(self) -> Vector3:
        """Return home in the world; the origin for a robot that reports no home."""
        if self._origin is None or self.home is None:
            return Vector3()
        return world_from_geo(self._origin, self.home)

    def descent_points(self, name: str) -> tuple[Vector3, ...]:
        """Return the path of a landing: straight down, or home at the present height and down there."""
        pose, home = self.fresh(), self.home_point()
        if pose is None:
            return ()
        here = pose.position
        if name == "land":
            return (Vector3(here.x, here.y, min(here.z, home.z)),)
        return (Vector3(home.x, home.y, max(here.z, home.z)), home)

    def route(self, task: AnyTask) -> tuple[Vector3, tuple[Vector3, ...]]:
        """Return start and points of a task; raises Refused while they are unknown."""
        pose = self.fresh()
        if pose is None:
            raise Refused(POSITION_UNKNOWN)
        match task:
            case GoTo():
                return pose.position, (self._point(task.goal),)
            case FollowPath():
                points = tuple(self._point(goal) for goal in task.goals)
                return pose.position, points if task.loops == 1 else (*points, *points[:1])
            case FlyMission():
                return pose.position, tuple(self._points_of(task))
            case FollowRobot():  # the other robot's path is unknown; the velocities are judged instead
                return pose.position, ()
        step = task.translation
        if task.body_frame:
            step = rotate_to_world(step, pose.rotation.yaw)
        return pose.position, (pose.position + step,)

    def _points_of(self, mission: FlyMission) -> Iterable[Vector3]:
        """Yield the points of a mission in the world."""
        ground = 0.0 if mission.above_sea or self.home is None else self.home.altitude
        for item in mission.items:
            if item.point is not None:
                height = item.point.altitude + ground
                yield self._point(Goal(geo=GeoPoint(item.point.latitude, item.point.longitude, height)))

    def _point(self, goal: Goal) -> Vector3:
        """Return a goal in the world; a goal without a height keeps the robot's."""
        if goal.position is not None:
            return goal.position
        world = self.world()
        if world is None or goal.geo is None:
            raise Refused("a place on Earth needs an origin in fleet.yaml, or a home")
        return world_from_geo(world, goal.geo)
