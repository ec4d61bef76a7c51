"""Duration for which a stop is repeated to a self-walking machine."""

from __future__ import annotations

import math

_AT_LEAST = 0.2  # s for which any stop is repeated


class StopRepeat:
    """Repeats a stop for a moment, an emergency stop until the machine has executed it (``pending``)."""

    def __init__(self) -> None:
        self.pending = False
        self._until = -math.inf

    def begin(self, now: float) -> None:
        """Begin a stop."""
        self._until = max(self._until, now + _AT_LEAST)

    def active(self, now: float, *, resting: bool) -> bool:
        """Return True while the stop must be sent; ``resting``: the machine's state shows its effect."""
        if now < self._until:
            return True
        self.pending = self.pending and not resting
        return self.pending
