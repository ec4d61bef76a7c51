"""The dead-man: a velocity lives for its lease and not a moment longer.

``DeadMan`` is the state of one robot, fed by the event loop and expired by the watchdog thread. Its lock is
held for a few instructions only, so a stuck loop cannot hold it.
"""

from __future__ import annotations

import math
import threading


class DeadMan:
    """One robot's running lease; ``until``: when it runs out (monotonic s), infinity without one."""

    __slots__ = ("_lock", "_running", "expired", "until")

    def __init__(self) -> None:
        self.until = math.inf
        self._lock = threading.Lock()
        self._running: set[DeadMan] = set()
        self.expired = 0

    def join(self, running: set[DeadMan]) -> None:
        """Be one of ``running`` while a lease runs: few of many robots are driven at a time.

        Who looks through them takes a ``copy``, which no other thread can come between; what makes its object
        while it reads (``tuple``, a loop) can be interrupted by a collection of garbage, and others let in.
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
        """Nothing is moving any more."""
        with self._lock:
            self._end()

    def expire(self, now: float) -> bool:
        """Return True, once, when the lease has run out."""
        with self._lock:
            if now < self.until:
                return False
            self._end()
            self.expired += 1
            return True

    def _end(self) -> None:
        """End the lease; under the lock."""
        self.until = math.inf
        self._running.discard(self)
