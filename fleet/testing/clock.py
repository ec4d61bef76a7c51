"""A manual clock; also exports the clock and the event loop of simulated time."""

from __future__ import annotations

from fleet.runtime.simulated_time import EPOCH, JumpingLoop, LoopClock

__all__ = ["JumpingLoop", "LoopClock", "ManualClock"]


class ManualClock:
    """A fleet.clock.Clock that moves only when the test advances it."""

    def __init__(self, *, monotonic: float = 1000.0, time: float = EPOCH) -> None:
        self._monotonic = monotonic
        self._time = time

    def monotonic(self) -> float:
        """Return monotonic seconds."""
        return self._monotonic

    def time(self) -> float:
        """Return Unix seconds."""
        return self._time

    def advance(self, seconds: float) -> None:
        """Let time pass; raises ValueError for a negative time."""
        if seconds < 0:
            raise ValueError("time does not run backwards; step() sets the wall clock")
        self._monotonic += seconds
        self._time += seconds

    def step(self, seconds: float) -> None:
        """Set the wall clock forward or back, as a time server does; no time passes."""
        self._time += seconds
