"""How long to wait before trying again."""

from __future__ import annotations

import random


class Backoff:
    """Doubles from the first wait to the longest, in seconds, each shortened at random by up to a half.

    The randomness keeps a fleet of edges from coming back all at once after the broker restarts.
    """

    def __init__(self, first: float, longest: float) -> None:
        self._first = first
        self._longest = longest
        self._next = first

    def wait(self) -> float:
        """Return the next wait."""
        wait, self._next = self._next, min(self._next * 2, self._longest)
        return wait * random.uniform(0.5, 1.0)  # noqa: S311 - it spreads load and guards nothing

    def note(self, lasted: float) -> None:
        """Note how many seconds a success lasted; after one longer than the longest wait, begin again.

        A shorter one does not count, so that a broker that lets in and throws out is not hammered.
        """
        if lasted > self._longest:
            self._next = self._first
