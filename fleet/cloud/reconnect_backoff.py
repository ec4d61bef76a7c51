"""Delays between attempts to connect to the cloud."""

from __future__ import annotations

from fleet.link.backoff import backoff

JITTER = 0.5
"""Largest share by which a delay is randomly shortened.

Without it all edges would reconnect at once after a restart of the broker.
"""


class Backoff:
    """Delays in seconds, doubling from the first to the longest."""

    def __init__(self, first: float, longest: float) -> None:
        self._first = first
        self._longest = longest
        self._waits = backoff(first, longest, jitter=JITTER)

    def wait(self) -> float:
        """Return the next delay."""
        return next(self._waits)

    def note(self, lasted: float) -> None:
        """Record how many seconds a connection lasted; reset the delays if it exceeded the longest one.

        A shorter connection does not count, so that a broker that accepts and then disconnects is not
        hammered.
        """
        if lasted > self._longest:
            self._waits = backoff(self._first, self._longest, jitter=JITTER)
