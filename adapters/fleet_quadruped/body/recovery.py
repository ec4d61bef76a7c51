"""Getting up from whatever side it lies on: the legs are folded, and it rolls until it is upright."""

from __future__ import annotations

from fleet_quadruped.body.motion import PostureMotion, freeing, rolling
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import Twelve

_TRIES = 5


class Recovery:
    """The motions of one recovery after another. ``tries``: how often it has rolled in this one."""

    def __init__(self, dog: DogDescription) -> None:
        self.tries = 0
        self._dog = dog

    def begin(self, angles: Twelve) -> PostureMotion:
        """Begin a recovery: fold the legs, a trapped one after it is stretched."""
        self.tries = 0
        return freeing(self._dog, angles)

    def roll(self, lean: float, angles: Twelve) -> PostureMotion | None:
        """Return the next roll of a dog that leans (rad), to the other side at every second try.

        None when it has rolled often enough, or cannot roll.
        """
        if self.tries >= _TRIES or self._dog.poses.roll_near is None:
            return None
        to_left = (lean > 0) == (self.tries % 2 == 0)
        self.tries += 1
        return rolling(self._dog, angles, to_left=to_left)
