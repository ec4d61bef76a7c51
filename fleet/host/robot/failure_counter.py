"""Failure counter of an adapter: too many within a short time cause a quarantine."""

from __future__ import annotations

MOST_FAILURES = 3
FAILURE_WINDOW = 60.0  # s


class FailureCounter:
    """Recent failures of one adapter."""

    def __init__(self) -> None:
        self._times: tuple[float, ...] = ()

    def count(self, now: float) -> None:
        """Count a failure at ``now`` (monotonic s)."""
        self._times = (*self._times, now)[-MOST_FAILURES:]

    @property
    def exceeded(self) -> bool:
        """True when ``MOST_FAILURES`` failures occurred within the window."""
        return len(self._times) == MOST_FAILURES and self._times[-1] - self._times[0] <= FAILURE_WINDOW

    def clear(self) -> None:
        """Clear the failures, because a person lifted the quarantine."""
        self._times = ()
