"""Confirmation of torque-off by the drives' own feedback."""

from __future__ import annotations

from collections.abc import Sequence

from fleet_quadruped.control.drive_summaries import all_off, holding
from fleet_quadruped.drives.base import JointsFeedback
from fleet_quadruped.robot.joint import Joint

_SEEN_OFF = 1.0  # s within which the drives must report that their torque is off


class TorqueOffMonitor:
    """Tracks whether the drives of a robot that is off confirm it. ``stale``: s after which one is silent."""

    def __init__(self, joints: Sequence[Joint], stale: float) -> None:
        self._joints = joints
        self._stale = stale
        self._confirmed = False
        self._off_for = 0.0  # s

    def update(self, reported: JointsFeedback, dt: float, *, off: bool) -> None:
        """Evaluate the feedback of a cycle; ``off``: the drives should be off."""
        self._confirmed = all_off(reported, self._stale)
        self._off_for = self._off_for + dt if off else 0.0

    @property
    def over(self) -> bool:
        """True when every drive has confirmed, or the time for it is over: see ``torque_on_fault``."""
        return self._confirmed or self._off_for > _SEEN_OFF

    def torque_on_fault(self, reported: JointsFeedback) -> str:
        """Describe the drive whose torque is still on although it should be off; empty if there is none."""
        if self._off_for <= _SEEN_OFF or self._confirmed:
            return ""
        held = holding(self._joints, reported)
        return f"{held}, wanted off" if held else ""
