"""Kinematic stand-in for a robot that has no simulator in simulated time.

It has the adapter's commands, limits and radii. It moves to its goals at the permitted speed, without
inertia; take-off and landing change its height; any other command takes a second and has no effect. It does
not reproduce the robot's own refusals.
"""

from __future__ import annotations

import asyncio
import functools
import math
from collections.abc import AsyncIterator, Callable, Mapping
from typing import Any, ClassVar

import msgspec

from fleet.adapter import Adapter, AnyAdapter, Robot
from fleet.commands import CommandSpec
from fleet.errors import NotReady, Unsupported
from fleet.model.geometry import (
    ZERO_VELOCITY,
    Pose,
    Vector3,
    Velocity,
    quaternion_from_yaw,
    rotate_to_world,
)
from fleet.model.navigation import FollowPath, Goal, GoTo, Progress, RelativeMove, Task
from fleet.model.report import BatteryReport, PoseReport
from fleet.robot_config import AdapterConfig

STEP = 0.02  # s
POSES = 0.1  # s between poses
BATTERIES = 2.0  # s between battery reports
LASTS = 1.0  # s of a command without effect
NEAR = 0.05  # m within which a goal is reached
SPEED = 1.0  # m/s of a robot without limits
HEIGHT = 5.0  # m of a take-off without a given altitude
POSE, BATTERY = "pose", "battery"
"""Keys of ``robot.state`` for its initial pose and its battery in percent."""
_METHOD = "stand_in_"


class StandIn(Adapter[AdapterConfig]):
    """Replaces a robot of the class ``played``; created by ``stand_in_for``."""

    played: ClassVar[type[AnyAdapter]]
    failsafe = "it moves nothing"

    def __init__(self, config: AdapterConfig, robot: Robot) -> None:
        super().__init__(config, robot)
        start: Pose = robot.state.get(POSE, Pose())
        self._at, self._yaw = start.position, start.rotation.yaw
        self._ground = 0.0 if start.position.z > 1.0 else start.position.z
        self._battery: float | None = robot.state.get(BATTERY)
        self._held = ZERO_VELOCITY
        self._goal: Vector3 | None = None
        self._speed = math.inf  # m/s, limit of the present task

    @classmethod
    def commands(cls) -> Mapping[str, CommandSpec]:
        """Return the commands of the robot, mapped to methods of this class."""
        return {
            name: msgspec.structs.replace(spec, method=_METHOD + name, streams=False)
            for name, spec in cls.played.commands().items()
        }

    @classmethod
    def drives(cls) -> bool:
        """Return the same as the robot's adapter."""
        return cls.played.drives()

    @classmethod
    def navigates(cls) -> bool:
        """Return the same as the robot's adapter."""
        return issubclass(cls.played, Adapter) and cls.played.navigates()

    def __getattr__(self, name: str) -> Callable[..., Any]:
        """Return the method for a command of the robot."""
        if not name.startswith(_METHOD):
            raise AttributeError(name)
        return functools.partial(self._carry_out, name.removeprefix(_METHOD))

    async def connect(self) -> None:
        """Start the periodic motion and reports."""
        self.robot.every(STEP, self._step)
        self.robot.every(POSES, self._report_pose)
        if self._battery is not None:
            self.robot.every(BATTERIES, self._report_battery_level)

    def drive(self, velocity: Velocity) -> None:
        """Move with this body velocity at once."""
        self._goal, self._held = None, velocity

    async def stop(self, reason: str) -> None:  # noqa: ARG002 - the same for any reason
        """Stop moving."""
        self.halt()

    def halt(self) -> None:
        """Stop moving."""
        self._goal, self._held = None, ZERO_VELOCITY

    async def navigate(self, task: Task) -> AsyncIterator[Progress]:
        """Move to the goals of a task in straight lines."""
        if isinstance(task, RelativeMove):
            step = rotate_to_world(task.translation, self._yaw) if task.body_frame else task.translation
            goals = [self._at + step]
        elif isinstance(task, GoTo | FollowPath):
            goals = [_point(goal) for goal in _goals(task)]
        else:
            raise Unsupported("a kinematic stand-in flies no plans: it knows nothing of the Earth")
        self._speed = task.constraints.max_speed or math.inf
        for number, goal in enumerate(goals):
            async for _ in self._go(goal):
                yield Progress(100.0 * number / len(goals), reached=number)

    async def _carry_out(self, name: str, **data: Any) -> None:
        """Execute a command."""
        self._speed = math.inf
        up = Vector3(self._at.x, self._at.y, data.get("altitude") or HEIGHT)
        over_home = Vector3(0.0, 0.0, self._at.z)
        routes = {"takeoff": [up], "land": [self._down(self._at)]}
        routes["return_to_home"] = [over_home, self._down(over_home)]
        for goal in routes.get(name, ()):
            async for _ in self._go(goal):
                pass
        if name not in routes:
            await asyncio.sleep(LASTS)

    def _down(self, point: Vector3) -> Vector3:
        """Return the ground below a point."""
        return Vector3(point.x, point.y, self._ground)

    async def _go(self, goal: Vector3) -> AsyncIterator[None]:
        """Move to a point of the world frame; raises NotReady if halted on the way."""
        self._goal, self._held = goal, ZERO_VELOCITY
        while self._goal is goal:
            yield
            await asyncio.sleep(POSES)
        if (goal - self._at).norm() > NEAR:
            raise NotReady("it was halted on the way")

    def _step(self) -> None:
        """Advance the position by one step."""
        offset = rotate_to_world(self._held.linear, self._yaw).scaled(STEP)
        if self._goal is not None:
            offset = self._goal - self._at
            most = STEP * min(self._speed, self.robot.limits.speed or SPEED)
            if offset.norm() > most:
                offset = offset.scaled(most / offset.norm())
            else:
                self._goal = None
        self._yaw += self._held.yaw_rate * STEP
        self._at = self._at + offset
        self._drain(moves=offset.norm() > 0.0)

    def _drain(self, *, moves: bool) -> None:
        """Discharge the battery for a step, if fleet.yaml gives its endurance."""
        policy = self.config.battery_policy
        if moves and self._battery is not None and policy is not None and policy.endurance is not None:
            self._battery = max(0.0, self._battery - 100.0 * STEP / policy.endurance)

    def _report_pose(self) -> None:
        """Report the pose."""
        self.robot.report(PoseReport(self.robot.clock.time(), self._at, quaternion_from_yaw(self._yaw)))

    def _report_battery_level(self) -> None:
        """Report the battery."""
        self.robot.report(BatteryReport(self.robot.clock.time(), self._battery))


@functools.lru_cache(maxsize=64)
def stand_in_for(played: type[AnyAdapter]) -> type[StandIn]:
    """Return the stand-in class for robots of a class."""

    class StandInParts(StandIn):
        Config = played.Config
        limits = played.limits
        separation = played.separation
        holonomic = played.holonomic
        combines_keys = played.combines_keys

    StandInParts.played = played
    return StandInParts


def _goals(task: GoTo | FollowPath) -> tuple[Goal, ...]:
    """Return the goals of a task, in order."""
    return (task.goal,) if isinstance(task, GoTo) else task.goals * task.loops


def _point(goal: Goal) -> Vector3:
    """Return a goal in the world frame; raises Unsupported for a goal on Earth."""
    if goal.position is None:
        raise Unsupported("a kinematic stand-in knows nothing of the Earth: write the point in metres")
    return goal.position
