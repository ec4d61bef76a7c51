"""Failure counter of an adapter: too many within a short time cause a quarantine."""

from __future__ import annotations

STRIKES = 3
STRIKE_WINDOW = 60.0  # s


class Strikes:
    """Recent failures of one adapter."""

    def __init__(self) -> None:
        self._times: tuple[float, ...] = ()

    def count(self, now: float) -> None:
        """Count a failure at ``now`` (monotonic s)."""
        self._times = (*self._times, now)[-STRIKES:]

    @property
    def are_out(self) -> bool:
        """True when ``STRIKES`` failures occurred within the window."""
        return len(self._times) == STRIKES and self._times[-1] - self._times[0] <= STRIKE_WINDOW

    def clear(self) -> None:
        """Clear the failures, because a person lifted the quarantine."""
        self._times = ()
