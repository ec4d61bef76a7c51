"""A clock that tests turn, one that goes as their event loop does, and a loop whose time does not wait."""

from __future__ import annotations

import selectors
from asyncio import AbstractEventLoop, SelectorEventLoop

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


class _Jumping(selectors.SelectSelector):
    """Never waits: the loop's time jumps to where it would have woken up."""

    def __init__(self) -> None:
        super().__init__()
        self.jumped = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Return what is ready now; where nothing is, let the time pass that there was to wait."""
        ready = super().select(0)
        if ready or timeout is None:
            return ready or super().select(timeout)
        self.jumped += max(timeout, 0.0)
        return []


class JumpingLoop(SelectorEventLoop):
    """An event loop whose seconds pass as soon as nothing is left to do in them."""

    def __init__(self) -> None:
        self._jumping = _Jumping()
        super().__init__(self._jumping)

    def time(self) -> float:
        """Return the seconds that were jumped over, from a day of the test's own."""
        return 1000.0 + self._jumping.jumped
