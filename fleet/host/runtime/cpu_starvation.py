"""Whether this process gets the processor when it wants it; pure.

A computer with too much to do makes every robot look late. That is the computer's fault, and is told as such.
"""

from __future__ import annotations

STARVED = 0.5  # share of the time that the event loop's thread waited for a processor
REMEMBERED = 5.0  # s for which it is told


class CpuStarvation:
    """Looked at about once a second; ``problem`` is empty while there is none."""

    def __init__(self, now: float, waited: float) -> None:
        self._now = now
        self._waited = waited
        self._share = 0.0
        self._until = now

    def look(self, now: float, waited: float) -> None:
        """Take how many seconds the thread has waited for a processor so far, at ``now`` (monotonic s)."""
        elapsed, more = now - self._now, waited - self._waited
        self._now, self._waited = now, waited
        if elapsed > 0 and more / elapsed >= STARVED:
            self._share, self._until = min(more / elapsed, 1.0), now + REMEMBERED

    @property
    def problem(self) -> str:
        """What is wrong, in words."""
        if self._now >= self._until:
            return ""
        return f"this computer is overloaded: the edge waited {self._share:.0%} of the time for a processor"
