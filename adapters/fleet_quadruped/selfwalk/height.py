"""Requested standing height of a self-walking machine."""

from __future__ import annotations

import math

from fleet import CanFrame
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.selfwalk.description import SelfWalker

_STANDS = frozenset({BodyMode.STANDING, BodyMode.WALKING})


class StandingHeight:
    """The last requested standing height (``value``, m)."""

    def __init__(self, walker: SelfWalker) -> None:
        self.value = walker.height
        self._walker = walker
        self._frame = walker.wire.height

    def change(self, change: float, mode: BodyMode) -> tuple[CanFrame | None, str]:
        """Return the frame that changes the height by ``change`` (m), and why not; empty if accepted."""
        if self._frame is None:
            return None, "this machine's description has no height"
        if mode not in _STANDS:
            return None, f"it is {mode.value}; stand up first"
        if not math.isfinite(change):
            return None, f"{change} is not a height"
        self.value = max(self._walker.lowest, min(self._walker.highest, self.value + change))
        return self._frame(self.value), ""
