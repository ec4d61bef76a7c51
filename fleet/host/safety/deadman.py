"""Dead-man: a velocity is held for its lease and no longer.

``DeadMan`` is the state of one robot, fed by the event loop and expired by the watchdog thread. Its lock is
held for a few instructions only, so a blocked loop cannot hold it.
"""

from __future__ import annotations

import math
import threading


class DeadMan:
    """Dead-man lease of one robot; ``until`` is its expiry (monotonic s), infinity without a lease."""

    __slots__ = ("_lock", "_running", "expired", "until")

    def __init__(self) -> None:
        self.until = math.inf
        self._lock = threading.Lock()
        self._running: set[DeadMan] = set()
        self.expired = 0

    def join(self, running: set[DeadMan]) -> None:
        """Register in ``running`` while a lease runs: only a few of many robots are driven at a time.

        Readers in other threads take a ``copy()``, which is atomic. ``tuple()`` or a loop allocates while it
        iterates, so the garbage collector may run and let another thread change the set.
        """
        with self._lock:
            self._running.discard(self)
            self._running = running
            if self.until != math.inf:
                running.add(self)

    @property
    def armed(self) -> bool:
        """True while a velocity is being held."""
        return self.until != math.inf

    def feed(self, now: float, lease: float) -> None:
        """Hold a fresh setpoint for ``lease`` seconds from ``now`` (monotonic)."""
        with self._lock:
            self.until = now + lease
            self._running.add(self)

    def clear(self) -> None:
        """End the lease: nothing moves any more."""
        with self._lock:
            self._end()

    def expire(self, now: float) -> bool:
        """Return True once when the lease has expired."""
        with self._lock:
            if now < self.until:
                return False
            self._end()
            self.expired += 1
            return True

    def _end(self) -> None:
        """End the lease; the caller holds the lock."""
        self.until = math.inf
        self._running.discard(self)
