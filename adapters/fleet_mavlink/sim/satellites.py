"""Simulated estimator without satellites, as recorded with both autopilots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Loss:
    """Loss of position of one autopilot. Times are seconds after the loss of satellites.

    ``shown``: when the receiver reports it; ``fix``, ``count``, ``error``: its values then (error in
    centimetres). ``flags``: times and flags of the estimator; ``drifts``: start of the drift, with ``pull``
    m/s2 up to ``most`` m/s.
    """

    shown: float
    fix: int
    count: int
    error: int
    flags: tuple[tuple[float, int], ...]
    drifts: float
    pull: float
    most: float


ARDUPILOT_LOSS = Loss(0.9, 1, 3, 121, ((7.9, 0x0025), (15.2, 0x00A7)), 15.2, 0.5, 0.8)
PX4_LOSS = Loss(0.4, 0, 0, 10000, ((5.5, 0x0365), (7.5, 0x0065)), 5.5, 0.6, 14.7)
GOOD, STARTING = 0x033F, 0x00A7


class Drift:
    """Error of the estimated position to the east, m, and its speed."""

    def __init__(self, loss: Loss) -> None:
        self.loss = loss
        self.east = 0.0
        self.speed = 0.0

    def tick(self, lost_for: float | None, dt: float) -> None:
        """Advance; with satellites the error is gone at once."""
        if lost_for is None:
            self.east = self.speed = 0.0
        elif lost_for > self.loss.drifts:
            self.speed = min(self.loss.most, self.speed + self.loss.pull * dt)
            self.east += self.speed * dt

    def flags(self, lost_for: float | None, *, usable: bool) -> int:
        """Return the estimator's flags."""
        if lost_for is not None:
            passed = [flags for after, flags in self.loss.flags if lost_for >= after]
            if passed:
                return passed[-1]
        return GOOD if usable else STARTING


class GpsReceiver:
    """The satellite receiver of one vehicle, and the drift of the estimated position without satellites.

    ``is_off`` returns True while the receiver is switched off, ``found`` True once it has found satellites
    after boot; ``now`` returns the simulation's time, s.
    """

    def __init__(
        self,
        loss: Loss,
        now: Callable[[], float],
        *,
        is_off: Callable[[], bool],
        found: Callable[[], bool],
    ) -> None:
        self.drift = Drift(loss)
        self._now = now
        self._is_off = is_off
        self._found = found
        self._lost_at: float | None = None

    @property
    def fix(self) -> bool:
        """True while the receiver has a position."""
        return self._found() and not self._is_off()

    @property
    def lost_for(self) -> float | None:
        """Seconds since the satellites were lost, None while there are some."""
        return None if self._lost_at is None else self._now() - self._lost_at

    def tick(self, dt: float) -> None:
        """Note the loss of satellites, and let the estimate drift for ``dt`` seconds."""
        if not self._is_off():
            self._lost_at = None
        elif self._lost_at is None:
            self._lost_at = self._now()
        self.drift.tick(self.lost_for, dt)
