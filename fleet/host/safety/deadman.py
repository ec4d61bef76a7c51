"""The dead-man: a velocity lives for its lease and not a moment longer.

``DeadMan`` is the state of one robot, fed by the event loop and expired by the watchdog thread. Its lock is
held for a few instructions only, so a stuck loop cannot hold it.
"""

from __future__ import annotations

import math
import threading


class DeadMan:
    """One robot's running lease; ``until``: when it runs out (monotonic s), infinity without one."""

    __slots__ = ("_lock", "expired", "until")  # hundreds are looked through fifty times a second

    def __init__(self) -> None:
        self.until = math.inf
        self._lock = threading.Lock()
        self.expired = 0

    @property
    def armed(self) -> bool:
        """True while a velocity is being held."""
        return self.until != math.inf

    def feed(self, now: float, lease: float) -> None:
        """Hold a fresh setpoint for ``lease`` seconds from ``now`` (monotonic)."""
        with self._lock:
            self.until = now + lease

    def clear(self) -> None:
        """Nothing is moving any more."""
        with self._lock:
            self.until = math.inf

    def expire(self, now: float) -> bool:
        """Return True, once, when the lease has run out."""
        with self._lock:
            if now < self.until:
                return False
            self.until = math.inf
            self.expired += 1
            return True
