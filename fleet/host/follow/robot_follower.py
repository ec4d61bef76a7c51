"""Guides a robot after another one, at a distance. Pure; gets poses.

The robot drives straight towards the other, slows as it comes near, and stands at the distance. It never
drives backwards: if the other robot approaches, the separation of both keeps them apart. The task has no end.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from fleet.host.follow.motion_laws import (
    MotionLimits,
    bearing,
    distance,
    holonomic_velocity,
    pursue,
    ramp,
    turning,
)
from fleet.model.geometry import ZERO_VELOCITY, Pose, Vector3, Velocity
from fleet.model.navigation import Progress

SLACK = 0.3  # m beyond the distance before a standing robot starts again
TURN_ABOVE = 0.7  # rad between heading and target at which the robot turns on the spot
STALE = 1.0  # s after which the other robot's position is too old to follow

TargetPosition = Callable[[], tuple[Vector3, float]]
"""Returns the other robot's last position, in the world of the follower, and its age in seconds.

Raises NotReady where it is unknown, or was not reported for too long.
"""


class RobotFollower:
    """Follower of another robot; ``step`` is called with each new pose, about 20 times a second."""

    done = False

    def __init__(
        self,
        metres: float,
        where: TargetPosition,
        pace: MotionLimits,
        *,
        holonomic: bool,
        now: float,
    ) -> None:
        self._metres = metres
        self._where = where
        self._pace = pace
        self._holonomic = holonomic
        self._at = now
        self._requested = ZERO_VELOCITY
        self._goes = False
        self._message = ""

    def step(self, pose: Pose, now: float) -> Velocity:
        """Return the velocity to hold from now on; raises NotReady once the other robot is lost."""
        elapsed, self._at = min(max(now - self._at, 0.0), 0.5), now
        at, age = self._where()
        wanted = ZERO_VELOCITY if age > STALE else self._towards(pose, at)
        self._requested = wanted if wanted.is_zero else ramp(self._requested, wanted, self._pace, elapsed)
        return self._requested

    def progress(self) -> Progress:
        """Return the progress: always 0 %, since the task has no end."""
        return Progress(0.0, self._message)

    def _towards(self, pose: Pose, at: Vector3) -> Velocity:
        """Return the velocity towards a point, zero where it is near enough."""
        target = (at.x, at.y)
        left = distance(pose, target) - self._metres
        self._goes = left > (0.0 if self._goes else SLACK)
        if not self._goes:
            return ZERO_VELOCITY
        if self._holonomic:
            ahead = math.atan2(at.y - pose.position.y, at.x - pose.position.x)
            return holonomic_velocity(pose, target, left, ahead, self._pace)
        error = bearing(pose, target)
        if abs(error) > TURN_ABOVE:
            return Velocity(yaw_rate=turning(error, self._pace))
        return pursue(pose, target, left, self._pace, backwards=False)
