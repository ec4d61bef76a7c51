"""A dog whose joints are led one by one: slowly, and never far from the posture in which that began.

A dog that stands keeps standing: what is led is added to how it stands, feet on the ground, weight carried.
So small a reach moves no foot from under it. A dog that lies, or is held by a person, is held as it is found.
"""

from __future__ import annotations

from collections.abc import Sequence

from fleet_quadruped.body.measured import ZEROS, Targets
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import Twelve

Goal = Sequence[float | None]
"""Where each joint is to go, rad, in the order of ``JOINTS``; None, or empty: it stays."""


def window(dog: DogDescription, start: Twelve) -> tuple[tuple[float, float], ...]:
    """Return how far each joint may be led from a posture: its reach, within its limits; rad."""
    reach, margin = dog.safety.joint_reach, dog.safety.margin
    return tuple(
        (min(at, max(joint.low + margin, at - reach)), max(at, min(joint.high - margin, at + reach)))
        for joint, at in zip(dog.all_joints, start, strict=True)
    )


class Posing:
    """``start``: the posture in which it began. ``stands``: it stood then, so it is to be stood upon."""

    def __init__(self, dog: DogDescription, start: Twelve, *, stands: bool) -> None:
        self.start = start
        self.stands = stands
        self.leaves = False  # it goes back to how it began
        self._speed = dog.safety.joint_speed
        self._window = window(dog, start)
        self._added = ZEROS

    @property
    def is_back(self) -> bool:
        """True when every joint is where it began."""
        return self._added == ZEROS

    def step(self, dt: float, goal: Goal, base: Targets) -> Targets:
        """Return the targets after ``dt`` seconds; ``base`` is what it does without being led."""
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
