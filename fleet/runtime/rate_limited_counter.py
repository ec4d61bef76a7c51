"""Counter of refused or lost messages, logged at most once a minute per reason; and a plain rate limit.

Bad input can arrive a thousand times a second: the counters count all of it, the log stays readable.
"""

from __future__ import annotations

import logging
import threading
from collections import Counter

from fleet.clock import Clock

LOG_EVERY = 60.0  # s between log lines of one reason
A_MINUTE = 60.0  # s
MOST_REASONS = 500  # distinct reasons that are counted and logged; text from outside never becomes a reason
OTHERS = "others"  # counts all further reasons
LONGEST = 500  # characters of a log line: it may quote untrusted input


class RateLimit:
    """Limits events to ``most`` within any minute; times are monotonic seconds. Not thread-safe."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._passed: list[float] = []  # an edge has one for each kind of event of each robot

    def is_used(self, now: float) -> bool:
        """Return True when no further event may pass now."""
        return len(self._passed) == self._most and now - self._passed[0] < A_MINUTE

    def use(self, now: float) -> None:
        """Count one event."""
        if len(self._passed) == self._most:
            del self._passed[0]
        self._passed.append(now)


class RateLimitedCounter:
    """Counts messages by reason and logs some of them; thread-safe."""

    def __init__(self, log: logging.Logger, clock: Clock) -> None:
        self._log = log
        self._clock = clock
        self._lock = threading.Lock()
        self._counts: Counter[str] = Counter()
        self._unlogged: Counter[str] = Counter()
        self._logged_at: dict[str, float] = {}

    def add(self, reason: str, line: str, *arguments: object) -> None:
        """Count one, and log the line unless this reason was logged within the last minute."""
        now = self._clock.monotonic()
        with self._lock:
            if reason not in self._counts and len(self._counts) >= MOST_REASONS:
                reason = OTHERS
            self._counts[reason] += 1
            if now - self._logged_at.get(reason, float("-inf")) < LOG_EVERY:
                self._unlogged[reason] += 1
                return
            self._logged_at[reason] = now
            more = self._unlogged.pop(reason, 0)
        text = line % arguments if arguments else line
        text = text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
        self._log.warning("%s%s", text, f" ({more} more like this before)" if more else "")

    def counts(self) -> dict[str, int]:
        """Return the counts by reason."""
        with self._lock:
            return dict(self._counts)

    @property
    def total(self) -> int:
        """Sum over all reasons."""
        return sum(self.counts().values())
