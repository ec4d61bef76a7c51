"""What was refused or lost, counted by reason, and told at most once a minute; what may pass in a minute.

Bad input can come a thousand times a second: the counters keep all of it, the log keeps readable.
"""

from __future__ import annotations

import logging
import threading
from collections import Counter, deque

from fleet.clock import Clock

TELL_EVERY = 60.0  # s between lines of one reason
A_MINUTE = 60.0  # s
MOST_REASONS = (
    500  # that are counted, and told in a minute; what others say never becomes a reason of its own
)
OTHERS = "others"  # the reason of all beyond
LONGEST = 500  # characters of a line: who sends something bad may choose its words


class RateLimit:
    """At most so many within any minute; monotonic seconds. Not for several threads at once."""

    def __init__(self, most: int) -> None:
        self._passed: deque[float] = deque(maxlen=most)

    def is_used(self, now: float) -> bool:
        """Return whether no more may pass now."""
        return len(self._passed) == self._passed.maxlen and now - self._passed[0] < A_MINUTE

    def use(self, now: float) -> None:
        """Note that one passes."""
        self._passed.append(now)


class RateLimitedCounter:
    """Counts by reason; safe from any thread."""

    def __init__(self, log: logging.Logger, clock: Clock) -> None:
        self._log = log
        self._clock = clock
        self._lock = threading.Lock()
        self._counts: Counter[str] = Counter()
        self._untold: Counter[str] = Counter()
        self._told: dict[str, float] = {}

    def add(self, reason: str, line: str, *arguments: object) -> None:
        """Count one, and log the line unless this reason was told within the last minute."""
        now = self._clock.monotonic()
        with self._lock:
            if reason not in self._counts and len(self._counts) >= MOST_REASONS:
                reason = OTHERS
            self._counts[reason] += 1
            if now - self._told.get(reason, float("-inf")) < TELL_EVERY:
                self._untold[reason] += 1
                return
            self._told[reason] = now
            more = self._untold.pop(reason, 0)
        text = line % arguments if arguments else line
        text = text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
        self._log.warning("%s%s", text, f" ({more} more like this before)" if more else "")

    def counts(self) -> dict[str, int]:
        """Return how many there were, by reason."""
        with self._lock:
            return dict(self._counts)

    @property
    def total(self) -> int:
        """How many there were altogether."""
        return sum(self.counts().values())
