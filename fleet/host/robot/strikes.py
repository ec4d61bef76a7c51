"""Failures of an adapter within a short time: too many of them are a quarantine."""

from __future__ import annotations

from collections import deque

STRIKES = 3
STRIKE_WINDOW = 60.0  # s


class Strikes:
    """The last failures of one adapter."""

    def __init__(self) -> None:
        self._times: deque[float] = deque(maxlen=STRIKES)

    def count(self, now: float) -> None:
        """Count a failure, at a time of the monotonic clock in s."""
        self._times.append(now)

    @property
    def are_out(self) -> bool:
        """True when as many failures as are allowed came within the window."""
        return len(self._times) == STRIKES and self._times[-1] - self._times[0] <= STRIKE_WINDOW

    def clear(self) -> None:
        """Forget the failures, because a person lifted the quarantine."""
        self._times.clear()
