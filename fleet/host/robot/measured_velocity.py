"""Velocity of a robot measured from its positions, for robots that report none."""

from __future__ import annotations

from fleet.model.geometry import Vector3

MEASURED = 0.2  # s of poses over which the velocity is measured
GAP = 1.0  # s without a pose after which the measurement restarts


class MeasuredVelocity:
    """Velocity of a robot (``value``, m/s) measured from its positions."""

    def __init__(self) -> None:
        self.value = Vector3()
        self._at = Vector3()
        self._time = 0.0

    def observe(self, at: Vector3, now: float) -> None:
        """Add a position; the velocity is measured over several of them."""
        elapsed = now - self._time
        if elapsed < MEASURED:
            return
        self.value = (at - self._at).scaled(1 / elapsed) if elapsed <= GAP else Vector3()
        self._at, self._time = at, now
