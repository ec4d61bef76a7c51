"""Motions between postures as timed segments: standing up, sitting down, rolling over."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from fleet_quadruped.body.measured import ZEROS, Targets
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.names import Twelve

JointPath = Callable[[float], Twelve]
_FOLD_TIME = 0.8  # s
_TRAPPED = 1.3  # rad between a hip and its folded angle: the leg may lie under the body
_STRETCH, _STRETCH_TIME = 0.9, 0.6  # rad at the knee, s
_ROLL_TIME, _ROLL_HOLD = 0.7, 0.8  # s: compliant joints (MIT) need time to roll the robot over


class Segment(NamedTuple):
    """``seconds`` along a path (argument 0 to 1); without a path, straight to ``goal`` in joint space."""

    seconds: float
    goal: Twelve
    path: JointPath | None = None


class PostureMotion:
    """A sequence of segments, each starting where the last one ended."""

    def __init__(self, start: Twelve, segments: Sequence[Segment]) -> None:
        self._start = self._now = start
        self._segments = list(segments)
        self._time = 0.0

    @property
    def done(self) -> bool:
        """True once the last posture is reached."""
        return not self._segments

    def step(self, dt: float) -> Targets:
        """Return the targets after ``dt`` seconds."""
        self._time += dt
        while self._segments and self._time >= self._segments[0].seconds:
            segment = self._segments.pop(0)
            self._time -= segment.seconds
            self._start = segment.goal
        before = self._now
        self._now = self._place()
        speeds = tuple((now - then) / dt for now, then in zip(self._now, before, strict=True))
        return Targets(self._now, speeds, ZEROS)

    def _place(self) -> Twelve:
        if not self._segments:
            return self._start
        segment = self._segments[0]
        share = _smooth(self._time / segment.seconds)
        if segment.path is not None:
            return segment.path(share)
        return tuple(a + (b - a) * share for a, b in zip(self._start, segment.goal, strict=True))


def _smooth(share: float) -> float:
    """Return a share with zero speed and acceleration at both ends (minimum jerk)."""
    return share**3 * (share * (6 * share - 15) + 10)


def folding(dog: DogDescription, start: Twelve, seconds: float = _FOLD_TIME) -> PostureMotion:
    """Fold the legs under the body."""
    return PostureMotion(start, [Segment(seconds, dog.posture(dog.poses.fold))])


def freeing(dog: DogDescription, start: Twelve) -> PostureMotion:
    """Straighten all knees first if a leg lies across the body, then fold.

    A leg whose hip is far from its folded angle lies under or across the body. Folding it at once pulls the
    foot against the body, where compliant joints (MIT) get stuck.
    """
    fold = dog.posture(dog.poses.fold)
    hips = range(1, 12, 3)
    if max(abs(start[hip] - fold[hip]) for hip in hips) <= _TRAPPED:
        return folding(dog, start)
    stretched = tuple(
        _straighter(angle, joint) if number % 3 == 2 else angle
        for number, (angle, joint) in enumerate(zip(start, dog.all_joints, strict=True))
    )
    return PostureMotion(start, [Segment(_STRETCH_TIME, stretched), Segment(_FOLD_TIME, fold)])


def _straighter(angle: float, joint: Joint) -> float:
    """Return a knee angle nearer to the straight leg (0 rad), for either knee direction, within limits."""
    wanted = angle - math.copysign(min(_STRETCH, abs(angle)), angle)
    return min(max(wanted, min(joint.low, angle)), max(joint.high, angle))


def rising(dog: DogDescription, start: Twelve, height: float) -> PostureMotion:
    """Fold, crouch, and stand up."""
    low = dog.gait.lowest
    return PostureMotion(
        start,
        [
            Segment(_FOLD_TIME, dog.posture(dog.poses.fold)),
            Segment(dog.poses.rise_time / 2, dog.stance(low)),
            Segment(
                dog.poses.rise_time / 2,
                dog.stance(height),
                lambda share: dog.stance(low + (height - low) * share),
            ),
        ],
    )


def sitting(dog: DogDescription, start: Twelve, height: float) -> PostureMotion:
    """Lower the body from standing, and fold."""
    low = dog.gait.lowest
    return PostureMotion(
        start,
        [
            Segment(0.2, dog.stance(height)),
            Segment(
                dog.poses.sit_time / 2,
                dog.stance(low),
                lambda share: dog.stance(height + (low - height) * share),
            ),
            Segment(dog.poses.sit_time / 2, dog.posture(dog.poses.fold)),
        ],
    )


def rolling(dog: DogDescription, start: Twelve, *, to_left: bool) -> PostureMotion:
    """Roll over to one side and fold again; raises ValueError without roll poses in the description."""
    near, far = dog.poses.roll_near, dog.poses.roll_far
    if near is None or far is None:
        raise ValueError(f"{dog.robot.name} has no roll poses")
    roll = dog.posture(near, far) if to_left else dog.posture(far, near)
    fold = dog.posture(dog.poses.fold)
    return PostureMotion(
        start, [Segment(_ROLL_TIME, roll), Segment(_ROLL_HOLD, roll), Segment(_FOLD_TIME, fold)]
    )
