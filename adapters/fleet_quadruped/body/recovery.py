"""Recovery from any position: fold the legs, then roll until upright."""

from __future__ import annotations

from fleet_quadruped.body.motion import PostureMotion, freeing, rolling
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import Twelve

_TRIES = 5


class Recovery:
    """Motions of a recovery. ``tries``: number of rolls in the present one."""

    def __init__(self, dog: DogDescription) -> None:
        self.tries = 0
        self._dog = dog

    def begin(self, angles: Twelve) -> PostureMotion:
        """Begin a recovery: fold the legs, after straightening a trapped one."""
        self.tries = 0
        return freeing(self._dog, angles)

    def roll(self, lean: float, angles: Twelve) -> PostureMotion | None:
        """Return the next roll for a robot with this roll angle (rad); every second try goes the other way.

        None after the last try, or without roll poses.
        """
        if self.tries >= _TRIES or self._dog.poses.roll_near is None:
            return None
        to_left = (lean > 0) == (self.tries % 2 == 0)
        self.tries += 1
        return rolling(self._dog, angles, to_left=to_left)
