"""Joint mode: single joints move slowly, within a small window around the posture at its start.

A standing robot keeps standing: joint moves are added to its stance, which carries the weight. The window is
so small that no foot slips. A robot that lies, or is held by a person, keeps its present posture.
"""

from __future__ import annotations

from collections.abc import Sequence

from fleet_quadruped.body.measured import ZEROS, Targets
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import Twelve

JointGoal = Sequence[float | None]
"""Target of each joint, rad, in the order of ``JOINTS``; None, or an empty sequence: no target."""


def window(dog: DogDescription, start: Twelve) -> tuple[tuple[float, float], ...]:
    """Return the range of each joint around a posture, within its limits; rad."""
    reach, margin = dog.safety.joint_reach, dog.safety.margin
    return tuple(
        (min(at, max(joint.low + margin, at - reach)), max(at, min(joint.high - margin, at + reach)))
        for joint, at in zip(dog.all_joints, start, strict=True)
    )


class Posing:
    """Joint mode. ``start``: posture at its start. ``stands``: the robot stood then, and keeps standing."""

    def __init__(self, dog: DogDescription, start: Twelve, *, stands: bool) -> None:
        self.start = start
        self.stands = stands
        self.leaves = False  # return to the start
        self._speed = dog.safety.joint_speed
        self._window = window(dog, start)
        self._added = ZEROS

    @property
    def is_back(self) -> bool:
        """True when every joint is back at the start."""
        return self._added == ZEROS

    def step(self, dt: float, goal: JointGoal, base: Targets) -> Targets:
        """Return the targets after ``dt`` seconds; ``base``: targets without the joint moves."""
        if self.leaves:
            goal = self.start
        most, added = self._speed * dt, list(self._added)
        for number, wanted in enumerate(goal):
            if wanted is not None:
                low, high = self._window[number]
                far = min(max(wanted, low), high) - self.start[number] - added[number]
                added[number] += min(max(far, -most), most)
        speeds = tuple((now - then) / dt for now, then in zip(added, self._added, strict=True))
        self._added = tuple(added)
        angles = tuple(at + more for at, more in zip(base.angles, added, strict=True))
        return Targets(angles, speeds, base.torques)
