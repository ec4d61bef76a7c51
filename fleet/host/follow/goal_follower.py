"""Goal follower for robots without their own navigation: newest pose in, 20 velocities a second out."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from functools import partial
from typing import Any, Protocol

from fleet.adapter import Adapter
from fleet.clock import Clock
from fleet.errors import NotReady
from fleet.host.follow.leg_follower import TOLERANCE, LegFollower
from fleet.host.follow.legs import legs_of
from fleet.host.follow.motion_laws import NO_LIMIT, MotionLimits
from fleet.host.follow.robot_follower import RobotFollower
from fleet.model.geodesy import GeoOrigin
from fleet.model.geometry import ZERO_VELOCITY, Pose, Vector3, Velocity
from fleet.model.navigation import AnyTask, FollowRobot, Progress
from fleet.model.report import PoseReport, Report
from fleet.robot_config import AdapterConfig, Limits
from fleet.runtime.decoding import convert_strictly

PERIOD = 0.05  # s between two velocities
STALE = 0.5  # s after which a pose is too old to drive by
LOST = 2.0  # s after which the action fails
LEASE = 0.5  # s for which each velocity of the follower is held
SHARE = 0.9  # share of the robot's yaw rate that is used, so that clamping does not bend the path


class GoalNavigator(Protocol):
    """Guides a robot to a goal: an adapter, or the host's follower."""

    def navigate(self, task: AnyTask) -> AsyncIterator[Progress]:
        """Execute a task, yielding progress."""


OtherRobot = Callable[[str], tuple[Vector3, float]]
"""Returns a robot's last position, in the world of this one, and its age (s); raises NotReady if unknown."""


class GoalFollower:
    """The follower of one robot. ``drive`` is the controller's, with limits and dead-man.

    ``holonomic`` is called at the start of each task: some robots report it only once connected.
    """

    def __init__(
        self,
        *,
        drive: Callable[[Velocity], None],
        limits: Limits,
        holonomic: Callable[[], bool],
        origin: GeoOrigin | None,
        clock: Clock,
        other: OtherRobot,
    ) -> None:
        self._other = other
        self._drive = drive
        self._limits = limits
        self._holonomic = holonomic
        self._origin = origin
        self._clock = clock
        self._pose: Pose | None = None
        self._seen = 0.0

    def configure(self, _config: AdapterConfig, limits: Limits) -> None:
        """Apply changed limits from the next task on; held velocities are limited already."""
        self._limits = limits

    @property
    def has_pose(self) -> bool:
        """True once the robot has reported its pose."""
        return self._pose is not None

    def observe(self, report: Report) -> None:
        """Process a report; only poses count."""
        if isinstance(report, PoseReport):
            self._pose = Pose(report.position, report.rotation)
            self._seen = self._clock.monotonic()

    async def navigate(self, task: AnyTask) -> AsyncIterator[Progress]:
        """Execute a task; return at the goal. Raises Refused, NotReady or TimedOut; the caller stops it."""
        pose = self._fresh()
        if pose is None:
            raise NotReady("the robot's pose is too old", hint="is it reporting?")
        follower = self._follower(task, pose)
        while not follower.done:
            pose = self._fresh()
            self._drive(ZERO_VELOCITY if pose is None else follower.step(pose, self._clock.monotonic()))
            yield follower.progress()
            await asyncio.sleep(PERIOD)
        self._drive(ZERO_VELOCITY)

    def _follower(self, task: AnyTask, pose: Pose) -> LegFollower | RobotFollower:
        """Return the follower for a task."""
        now, pace, holonomic = self._clock.monotonic(), self._pace(task), self._holonomic()
        if isinstance(task, FollowRobot):
            where = partial(self._other, task.robot)
            return RobotFollower(task.distance, where, pace, holonomic=holonomic, now=now)
        tolerance = task.constraints.tolerance or TOLERANCE
        legs = legs_of(task, pose, self._origin)
        return LegFollower(legs, pose, pace, tolerance=tolerance, holonomic=holonomic, now=now)

    def _fresh(self) -> Pose | None:
        """Return the pose; None when it is too old to drive by. Raises NotReady when it is lost."""
        age = self._clock.monotonic() - self._seen
        if self._pose is None or age > LOST:
            raise NotReady(f"no pose for {age:.1f} s" if self._pose else "the robot has reported no pose")
        return self._pose if age <= STALE else None

    def _pace(self, task: AnyTask) -> MotionLimits:
        """Return the limits of motion for a task."""
        fastest = self._limits.speed or NO_LIMIT
        requested = task.constraints.max_speed
        yaw_rate = (self._limits.yaw_rate or NO_LIMIT) * SHARE
        return MotionLimits(min(fastest, requested) if requested else fastest, yaw_rate)


class _SelfNavigating:
    """A robot that navigates by itself, and is guided by the host only to follow other robots."""

    def __init__(self, adapter: Adapter[Any], leader: GoalFollower) -> None:
        self._adapter = adapter
        self._leader = leader

    def navigate(self, task: AnyTask) -> AsyncIterator[Progress]:
        """Execute a task, yielding progress."""
        if isinstance(task, FollowRobot):
            return self._leader.navigate(task)
        return self._adapter.navigate(task)


def goal_navigator(
    adapter: Adapter[Any] | None, leader: GoalFollower, *, navigates: bool, drives: bool
) -> GoalNavigator | None:
    """Return the navigator of a robot: its adapter, or the host's follower; None when neither can."""
    if adapter is not None and navigates:
        return _SelfNavigating(adapter, leader)
    return leader if adapter is not None and drives and leader.has_pose else None


def goal_follower_of(
    config: AdapterConfig,
    drive: Callable[[Velocity], None],
    limits: Limits,
    clock: Clock,
    other: OtherRobot,
    *,
    holonomic: Callable[[], bool],
) -> GoalFollower:
    """Return the follower of a robot of fleet.yaml."""
    place = config.origin
    origin = None if place is None else convert_strictly(place, GeoOrigin, from_attributes=True)
    return GoalFollower(
        drive=drive, limits=limits, holonomic=holonomic, origin=origin, clock=clock, other=other
    )
