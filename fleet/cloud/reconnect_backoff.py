"""How long to wait before trying the cloud again."""

from __future__ import annotations

from fleet.link.backoff import backoff

JITTER = 0.5
"""Share by which a wait is shortened at random at most: edges must not come back all at once after the broker
restarts."""


class Backoff:
    """Doubles from the first wait to the longest, in seconds."""

    def __init__(self, first: float, longest: float) -> None:
        self._first = first
        self._longest = longest
        self._waits = backoff(first, longest, jitter=JITTER)

    def wait(self) -> float:
        """Return the next wait."""
        return next(self._waits)

    def note(self, lasted: float) -> None:
        """Note how many seconds a success lasted; after one longer than the longest wait, begin again.

        A shorter one does not count, so that a broker that lets in and throws out is not hammered.
        """
        if lasted > self._longest:
            self._waits = backoff(self._first, self._longest, jitter=JITTER)
