"""Leads a robot after another one, to a distance; pure, fed with poses.

The robot goes straight towards the other, slows as it comes near, and stands once the distance is reached. It
does not go backwards: one that comes nearer is kept away by the separation of both. There is no end.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from fleet.host.follow.motion_laws import MotionLimits, bearing, distance, glide, pursue, ramp, turning
from fleet.model.geometry import ZERO_VELOCITY, Pose, Vector3, Velocity
from fleet.model.navigation import Progress

SLACK = 0.3  # m beyond the distance within which a robot that stands goes on standing
TURN_ABOVE = 0.7  # rad beside the way from which the robot turns on the spot
STALE = 1.0  # s after which the place of the other robot is too old to go by

Whereabouts = Callable[[], tuple[Vector3, float]]
"""Where the other robot was last, in the world of the one that is led, and how many seconds ago.

Raises NotReady where nobody knows, or has not known for too long.
"""


class RobotFollower:
    """One robot on the way after another; ``step`` is called with each new pose, about 20 times a second."""

    done = False

    def __init__(
        self,
        metres: float,
        where: Whereabouts,
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
        self._asked = ZERO_VELOCITY
        self._goes = False
        self._message = ""

    def step(self, pose: Pose, now: float) -> Velocity:
        """Return the velocity to hold from now on; raises NotReady once the other robot is lost."""
        elapsed, self._at = min(max(now - self._at, 0.0), 0.5), now
        at, age = self._where()
        wanted = ZERO_VELOCITY if age > STALE else self._towards(pose, at)
        self._asked = wanted if wanted.is_zero else ramp(self._asked, wanted, self._pace, elapsed)
        return self._asked

    def progress(self) -> Progress:
        """Return how far it is: it has no end to be near to."""
        return Progress(0.0, self._message)

    def _towards(self, pose: Pose, at: Vector3) -> Velocity:
        """Return the velocity that leads nearer to a point, zero where it is near enough."""
        target = (at.x, at.y)
        way = distance(pose, target) - self._metres
        self._goes = way > (0.0 if self._goes else SLACK)
        if not self._goes:
            return ZERO_VELOCITY
        if self._holonomic:
            ahead = math.atan2(at.y - pose.position.y, at.x - pose.position.x)
            return glide(pose, target, way, ahead, self._pace)
        error = bearing(pose, target)
        if abs(error) > TURN_ABOVE:
            return Velocity(yaw_rate=turning(error, self._pace))
        return pursue(pose, target, way, self._pace, backwards=False)
