"""State machine that guides a robot along the legs of a task. Pure; gets poses.

=======  ==========================================  =======================================
phase    motion of the robot                         transition
=======  ==========================================  =======================================
turn     turns on the spot towards the path          faces it: drive
drive    follows the path                            near the end: align; path abeam: turn
align    turns to the goal's heading                 reached: hold
hold     stands for a moment, then for the wait      time: next leg or done; drifted: turn, align
blocked  stands                                      time: turn (another attempt)
done     stands
=======  ==========================================  =======================================
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence

from fleet.errors import TimedOut
from fleet.host.follow.legs import Leg
from fleet.host.follow.motion_laws import (
    MotionLimits,
    bearing,
    distance,
    holonomic_velocity,
    pursue,
    ramp,
    turning,
)
from fleet.host.follow.path import Path
from fleet.host.follow.stuck import StuckDetector
from fleet.model.geometry import ZERO_VELOCITY, Pose, Velocity, wrap_angle
from fleet.model.navigation import Progress

TOLERANCE = 0.10  # m
TIGHTEST, WIDEST = 0.05, 2.0  # m; range of a task's own tolerance
NEAR = 0.5  # share of the tolerance at which driving ends
HEADING = 0.035  # rad of heading error that is accepted
HEADING_LOST = 0.07  # rad of heading error at which it turns again
TURN_ABOVE = 0.7  # rad between heading and path at which the robot turns on the spot
TURN_UNTIL = 0.12  # rad
HOLD = 0.4  # s at the goal until it counts as reached
LOOK_SHORTEST, LOOK_LONGEST = 0.25, 0.6  # m of look-ahead on the path
LOOK_TIME = 0.8  # s of look-ahead
REST = 2.0  # s for which a blocked robot stands before another attempt
GIVE_UP = 30.0  # s of attempts without progress


class FollowPhase(enum.StrEnum):
    """Phase of motion."""

    TURN = "turn"
    DRIVE = "drive"
    ALIGN = "align"
    HOLD = "hold"
    BLOCKED = "blocked"
    DONE = "done"


class LegFollower:
    """Follower of one task; ``step`` is called with each new pose, about 20 times a second."""

    def __init__(
        self,
        legs: Sequence[Leg],
        pose: Pose,
        pace: MotionLimits,
        *,
        tolerance: float,
        holonomic: bool,
        now: float,
    ) -> None:
        self._legs = tuple(legs)
        self._pace = pace
        self._tolerance = min(max(tolerance, TIGHTEST), WIDEST)
        self._holonomic = holonomic
        self._stuck = StuckDetector()
        self._requested = ZERO_VELOCITY
        self._number = -1
        self._leg = self._legs[0]
        self._path = Path([self._leg.points[0], *self._leg.points])
        self._travelled = 0.0
        self._reached = 0
        self._at = now
        self._since = now
        self._blocked_at: float | None = None
        self._blocked_remaining = 0.0
        self._percent = 0.0
        self.phase = FollowPhase.DONE
        self._begin_leg(pose, now)
        self._total = max(self._remaining(), 1e-3)

    @property
    def done(self) -> bool:
        """True once the last goal is reached."""
        return self.phase is FollowPhase.DONE

    def step(self, pose: Pose, now: float) -> Velocity:
        """Return the velocity to hold from now on; raises TimedOut when the robot stays blocked."""
        elapsed, self._at = min(max(now - self._at, 0.0), 0.5), now
        wanted = self._STEPS[self.phase](self, pose, now)
        resting = wanted.is_zero and self.phase is not FollowPhase.DRIVE
        self._requested = wanted if resting else ramp(self._requested, wanted, self._pace, elapsed)
        self._watch(pose, now)
        return self._requested

    def progress(self) -> Progress:
        """Return the progress; it never falls, and is 100 only at the end."""
        left = self._remaining()
        self._percent = max(self._percent, min(99.0, 100.0 * (1.0 - left / self._total)))
        blocked = self.phase is FollowPhase.BLOCKED
        message = "blocked: it is commanded and does not get on" if blocked else ""
        return Progress(
            self._percent, message, blocked, self._reached + self._path.passed(self._travelled), left
        )

    # -- the phases ------------------------------------------------------------------------------------

    def _turn(self, pose: Pose, now: float) -> Velocity:
        """Turn towards the path."""
        self._advance(pose)
        error = self._error(pose)
        if self._holonomic or abs(error) < TURN_UNTIL or self._is_near(pose):
            return self._enter(FollowPhase.DRIVE, now)
        return Velocity(yaw_rate=turning(error, self._pace))

    def _drive(self, pose: Pose, now: float) -> Velocity:
        """Follow the path."""
        self._advance(pose)
        if self._is_near(pose):
            return self._enter(FollowPhase.ALIGN, now)
        target, left = self._path.aim(self._travelled, self._look_ahead()), self._left(pose)
        if self._holonomic:
            yaw = pose.rotation.yaw if self._leg.yaw is None else self._leg.yaw
            return holonomic_velocity(pose, target, left, yaw, self._pace)
        if abs(self._error(pose)) > TURN_ABOVE:
            return self._enter(FollowPhase.TURN, now)
        return pursue(pose, target, left, self._pace, backwards=self._leg.backwards)

    def _align(self, pose: Pose, now: float) -> Velocity:
        """Turn to the goal's heading."""
        error = self._heading_error(pose)
        if abs(error) < HEADING:
            return self._enter(FollowPhase.HOLD, now)
        return Velocity(yaw_rate=turning(error, self._pace))

    def _hold(self, pose: Pose, now: float) -> Velocity:
        """Stand; return to a goal from which the robot has drifted."""
        if distance(pose, self._path.end) > self._tolerance:
            return self._enter(FollowPhase.TURN, now)
        if abs(self._heading_error(pose)) > HEADING_LOST:
            return self._enter(FollowPhase.ALIGN, now)
        if now - self._since >= HOLD + self._leg.wait:
            self._begin_leg(pose, now)
        return ZERO_VELOCITY

    def _rest(self, _pose: Pose, now: float) -> Velocity:
        """Stand, then try again."""
        if now - self._since >= REST:
            self._stuck.reset()
            self._enter(FollowPhase.TURN, now)
        return ZERO_VELOCITY

    def _stand(self, _pose: Pose, _now: float) -> Velocity:
        """Stand: the task has ended."""
        return ZERO_VELOCITY

    _STEPS = {  # noqa: RUF012 - a table
        FollowPhase.TURN: _turn,
        FollowPhase.DRIVE: _drive,
        FollowPhase.ALIGN: _align,
        FollowPhase.HOLD: _hold,
        FollowPhase.BLOCKED: _rest,
        FollowPhase.DONE: _stand,
    }

    # -- helpers ---------------------------------------------------------------------------------------

    def _enter(self, phase: FollowPhase, now: float) -> Velocity:
        """Enter a phase; its velocity starts with its next step."""
        self.phase, self._since = phase, now
        return ZERO_VELOCITY

    def _begin_leg(self, pose: Pose, now: float) -> None:
        """Start the next leg, or end."""
        if self._number >= 0:
            self._reached += len(self._leg.points)
        self._number += 1
        self._travelled = 0.0
        if self._number == len(self._legs):
            self._number -= 1
            self._path = Path([self._path.end, self._path.end])
            self._enter(FollowPhase.DONE, now)
            return
        self._leg = self._legs[self._number]
        self._path = Path([(pose.position.x, pose.position.y), *self._leg.points])
        self._enter(FollowPhase.TURN, now)

    def _advance(self, pose: Pose) -> None:
        """Update the robot's position on the path, which never goes backwards."""
        self._travelled = self._path.ahead((pose.position.x, pose.position.y), self._travelled)

    def _error(self, pose: Pose) -> float:
        """Return the angle between the robot's heading and the path."""
        return bearing(
            pose, self._path.aim(self._travelled, self._look_ahead()), backwards=self._leg.backwards
        )

    def _heading_error(self, pose: Pose) -> float:
        """Return the angle to the goal's heading; 0 when any heading is accepted."""
        return 0.0 if self._leg.yaw is None else wrap_angle(self._leg.yaw - pose.rotation.yaw)

    def _look_ahead(self) -> float:
        """Return the look-ahead distance."""
        return min(max(LOOK_TIME * self._requested.linear.horizontal(), LOOK_SHORTEST), LOOK_LONGEST)

    def _left(self, pose: Pose) -> float:
        """Return the metres until the robot must be slow."""
        left = self._path.to_corner(self._travelled)
        return max(left, min(left + 0.1, distance(pose, self._path.end)))

    def _is_near(self, pose: Pose) -> bool:
        """Return True at the end of the path: near it, or past it within the tolerance."""
        apart = distance(pose, self._path.end)
        ends = self._path.length - self._travelled < LOOK_SHORTEST
        behind = abs(bearing(pose, self._path.end, backwards=self._leg.backwards)) > math.pi / 2
        return ends and (apart < NEAR * self._tolerance or (behind and apart < 0.9 * self._tolerance))

    def _remaining(self) -> float:
        """Return the remaining metres of the whole task."""
        if self.phase is FollowPhase.DONE:
            return 0.0
        rest, last = self._path.length - self._travelled, self._path.end
        for leg in self._legs[self._number + 1 :]:
            rest += Path([last, *leg.points]).length
            last = leg.points[-1]
        return rest

    def _watch(self, pose: Pose, now: float) -> None:
        """Detect that the robot is stuck; raises TimedOut when it stays so."""
        if self.phase in {FollowPhase.BLOCKED, FollowPhase.DONE}:
            return
        remaining = self._remaining()
        if self._blocked_at is not None and remaining < self._blocked_remaining - self._tolerance:
            self._blocked_at = None
        if not self._stuck.update(pose, self._requested, remaining, now):
            return
        if self._blocked_at is None:
            self._blocked_at, self._blocked_remaining = now, remaining
        if now - self._blocked_at > GIVE_UP:
            raise TimedOut(f"blocked for {GIVE_UP:g} s with {remaining:.2f} m to go")
        self._requested = self._enter(FollowPhase.BLOCKED, now)
