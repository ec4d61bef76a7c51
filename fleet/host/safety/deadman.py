"""The dead-man: a velocity lives for its lease and not a moment longer.

``DeadMan`` is the state of one robot, fed by the event loop and expired by the watchdog thread. Its lock is
held for a few instructions only, so a stuck loop cannot hold it.
"""

from __future__ import annotations

import math
import threading


class DeadMan:
    """One robot's running lease."""

    def __init__(self) -> None:
        self._until = math.inf
        self._lock = threading.Lock()
        self.expired = 0

    @property
    def armed(self) -> bool:
        """True while a velocity is being held."""
        return self._until != math.inf

    @property
    def until(self) -> float:
        """When the lease runs out (monotonic s); infinity while nothing is held."""
        return self._until

    def feed(self, now: float, lease: float) -> None:
        """Hold a fresh setpoint for ``lease`` seconds from ``now`` (monotonic)."""
        with self._lock:
            self._until = now + lease

    def clear(self) -> None:
        """Nothing is moving any more."""
        with self._lock:
            self._until = math.inf

    def expire(self, now: float) -> bool:
        """Return True, once, when the lease has run out."""
        with self._lock:
            if now < self._until:
                return False
            self._until = math.inf
            self.expired += 1
            return True
