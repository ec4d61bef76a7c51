"""Detects that this process does not get enough processor time. Pure.

An overloaded computer makes every robot look late; the report names the computer as the cause.
"""

from __future__ import annotations

STARVED = 0.5  # share of the time for which the event loop's thread waited for a processor
REMEMBERED = 5.0  # s for which the problem is reported


class CpuStarvation:
    """CPU starvation, checked about once a second; ``problem`` is empty without any."""

    def __init__(self, now: float, waited: float) -> None:
        self._now = now
        self._waited = waited
        self._share = 0.0
        self._until = now

    def update(self, now: float, waited: float) -> None:
        """Add a sample: the thread's total waiting time for a processor in s, at ``now`` (monotonic s)."""
        elapsed, more = now - self._now, waited - self._waited
        self._now, self._waited = now, waited
        if elapsed > 0 and more / elapsed >= STARVED:
            self._share, self._until = min(more / elapsed, 1.0), now + REMEMBERED

    @property
    def problem(self) -> str:
        """Text of the problem; empty without one."""
        if self._now >= self._until:
            return ""
        return f"this computer is overloaded: the edge waited {self._share:.0%} of the time for a processor"
