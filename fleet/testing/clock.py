"""A clock that tests turn, and one that goes as their event loop does."""

from __future__ import annotations

from asyncio import AbstractEventLoop

_EPOCH = 1_800_000_000.0  # Unix s at which tests begin


class ManualClock:
    """A fleet.clock.Clock that stands still until it is told to go on."""

    def __init__(self, *, monotonic: float = 1000.0, time: float = _EPOCH) -> None:
        self._monotonic = monotonic
        self._time = time

    def monotonic(self) -> float:
        """Return seconds that never jump."""
        return self._monotonic

    def time(self) -> float:
        """Return Unix seconds."""
        return self._time

    def advance(self, seconds: float) -> None:
        """Let time pass; raises ValueError for time that runs backwards."""
        if seconds < 0:
            raise ValueError("time does not run backwards; step() sets the wall clock")
        self._monotonic += seconds
        self._time += seconds

    def step(self, seconds: float) -> None:
        """Set the wall clock forward or back, as a time server does; no time passes."""
        self._time += seconds


class LoopClock:
    """A fleet.clock.Clock that tells an event loop's time."""

    def __init__(self, loop: AbstractEventLoop) -> None:
        self._loop = loop
        self._began = loop.time()

    def monotonic(self) -> float:
        """Return seconds that never jump."""
        return self._loop.time()

    def time(self) -> float:
        """Return Unix seconds, of a day of the test's own."""
        return _EPOCH + self._loop.time() - self._began
