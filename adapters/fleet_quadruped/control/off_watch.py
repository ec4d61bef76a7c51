"""Confirmation that the torque is off: only the drives can say so."""

from __future__ import annotations

from collections.abc import Sequence

from fleet_quadruped.control.holding import all_off, holding
from fleet_quadruped.drives.base import Joints
from fleet_quadruped.robot.description import Joint

_SEEN_OFF = 1.0  # s in which drives must say that their torque is off


class OffWatch:
    """Whether the drives of a dog that is to be off confirm it. ``stale``: s after which one is silent."""

    def __init__(self, joints: Sequence[Joint], stale: float) -> None:
        self._joints = joints
        self._stale = stale
        self._confirmed = False
        self._off_for = 0.0  # s

    def look(self, told: Joints, dt: float, *, off: bool) -> None:
        """Look at the drives in a cycle; ``off``: the dog is to be off."""
        self._confirmed = all_off(told, self._stale)
        self._off_for = self._off_for + dt if off else 0.0

    @property
    def over(self) -> bool:
        """True when every drive has confirmed, or had time enough and did not: see ``still_on``."""
        return self._confirmed or self._off_for > _SEEN_OFF

    def still_on(self, told: Joints) -> str:
        """Return which drive keeps its torque although the dog is off; empty when none does."""
        if self._off_for <= _SEEN_OFF or self._confirmed:
            return ""
        held = holding(self._joints, told)
        return f"{held}, wanted off" if held else ""
