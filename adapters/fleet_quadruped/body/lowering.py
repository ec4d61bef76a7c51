"""Lowering of a robot in a hard stop: the legs fold from their present posture, then the torque goes off.

Drives that damp by themselves need no targets; the targets fold the others. A drive that brakes on its own,
or one on a silent bus, holds its leg stiff: the other legs wait for it, or the robot would tip over.
"""

from __future__ import annotations

from fleet_quadruped.body.measured import ZEROS, Targets
from fleet_quadruped.body.motion import PostureMotion, Segment
from fleet_quadruped.robot.description import DogDescription, leg_angles
from fleet_quadruped.robot.names import Twelve

_SHARE = 0.6  # share of the time until torque-off in which the legs fold
_TOUCH = 0.15  # s in which lifted feet come down: on two legs the robot would fall sideways
_PATIENCE = 1.0  # s that the legs wait for a drive that brakes


def level(dog: DogDescription, posture: Twelve) -> Twelve:
    """Return the angles with all feet as low as the lowest one."""
    feet = [leg.foot(leg_angles(posture, number)) for number, leg in enumerate(dog.legs)]
    deepest = min(z for _, _, z in feet)
    angles = [leg.angles((x, y, deepest)) for leg, (x, y, _) in zip(dog.legs, feet, strict=True)]
    return tuple(angle for each in angles for angle in each)


class Lowering:
    """One lowering. ``done``: the torque may go off; ``stuck``: a drive keeps braking and cannot be moved."""

    def __init__(self, dog: DogDescription, start: Twelve, *, upright: bool) -> None:
        self._until = dog.safety.damp_time
        fold = Segment(_SHARE * self._until, dog.posture(dog.poses.fold))
        segments = [Segment(_TOUCH, level(dog, start)), fold] if upright else [fold]
        self._motion = PostureMotion(start, segments)
        self._targets = Targets(start, ZEROS, ZEROS)
        self._moved = self._waited = 0.0  # s

    @property
    def done(self) -> bool:
        """True once the legs are folded and have had time to settle."""
        return self._moved > self._until

    @property
    def stuck(self) -> bool:
        """True after waiting too long."""
        return self._waited > _PATIENCE

    def step(self, dt: float, *, braked: bool) -> Targets:
        """Return the targets after ``dt`` seconds; while ``braked``, all joints hold their positions."""
        if braked:
            self._waited += dt
            self._targets = Targets(self._targets.angles, ZEROS, ZEROS)
        else:
            self._waited = 0.0
            self._moved += dt
            self._targets = self._motion.step(dt)
        return self._targets
