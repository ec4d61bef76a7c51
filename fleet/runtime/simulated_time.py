"""Simulated time: a clock that goes as its event loop does, and an event loop that never waits.

Rehearsals and tests run in it. Seconds pass as soon as nothing is left to do in them, so that the same work
always happens at the same time.
"""

from __future__ import annotations

import selectors
from asyncio import AbstractEventLoop, SelectorEventLoop
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

EPOCH = 1_800_000_000.0  # Unix s at which simulated time begins


class LoopClock:
    """A fleet.clock.Clock that tells an event loop's time."""

    def __init__(self, loop: AbstractEventLoop) -> None:
        self._loop = loop
        self._began = loop.time()

    def monotonic(self) -> float:
        """Return seconds that never jump."""
        return self._loop.time()

    def time(self) -> float:
        """Return Unix seconds, of a day of its own."""
        return EPOCH + self._loop.time() - self._began


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


class _AtOnce(ThreadPoolExecutor):
    """Makes calls that may block on the event loop's own thread: no time passes meanwhile."""

    def submit(self, call: Callable[..., Any], /, *arguments: Any, **more: Any) -> Future[Any]:
        """Make a call, and return its result."""
        done: Future[Any] = Future()
        try:
            done.set_result(call(*arguments, **more))
        except Exception as error:  # noqa: BLE001 - whoever waits is to have it
            done.set_exception(error)
        return done


class JumpingLoop(SelectorEventLoop):
    """An event loop whose seconds pass as soon as nothing is left to do in them.

    What is given to threads is done at once (``_AtOnce``): no thread races with time.
    """

    def __init__(self) -> None:
        self._jumping = _Jumping()
        super().__init__(self._jumping)
        self.set_default_executor(_AtOnce())

    def time(self) -> float:
        """Return the seconds that were jumped over, from a beginning of its own."""
        return 1000.0 + self._jumping.jumped
