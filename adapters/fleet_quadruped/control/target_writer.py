"""Output of the body, written to the drives within the limits."""

from __future__ import annotations

from fleet_quadruped.body.machine import BodyOutput, DriveAction
from fleet_quadruped.body.measured import ZEROS, Targets
from fleet_quadruped.drives.base import JointDrive, JointsFeedback
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import Twelve
from fleet_quadruped.safety.limits import JointLimits


class TargetWriter:
    """Writes targets to the drives.

    ``last``: the last written angles, rad. ``clamped``: number of targets changed by the limits.
    """

    def __init__(self, dog: DogDescription, drives: JointDrive) -> None:
        self.last: Twelve = ZEROS
        self.clamped = 0
        self._drives = drives
        self._kd = dog.safety.kd
        self._stale = dog.safety.stale_cycles * dog.dt
        self._limits = JointLimits(dog.all_joints, dog.safety)

    def write(self, wanted: BodyOutput, joints: JointsFeedback, dt: float) -> None:
        """Write the output of one cycle to the drives."""
        match wanted.action:
            case DriveAction.HOLD:
                self._drives.write(self._limited(wanted.targets, joints.angles, dt))
                return
            case DriveAction.LOWER:
                self._drives.lower(self._limited(wanted.targets, self._known(joints), dt), self._kd)
                return
            case DriveAction.ENABLE:
                self._drives.enable()
            case DriveAction.DAMP:
                self._drives.damp(self._kd)
            case DriveAction.RESET:
                self._drives.reset_fault()
            case DriveAction.REST:
                self._drives.disable()
        self.last = joints.angles

    def _limited(self, targets: Targets, measured: Twelve, dt: float) -> Targets:
        """Return targets within the limits."""
        safe = self._limits.limit(targets, self.last, measured, dt)
        self.clamped += safe.clamped
        self.last = safe.targets.angles
        return safe.targets

    def _known(self, joints: JointsFeedback) -> Twelve:
        """Return the joint angles; a silent joint counts as being at its last target."""
        reported = zip(joints.angles, joints.ages, self.last, strict=True)
        return tuple([last if age > self._stale else angle for angle, age, last in reported])
