"""Simulated time: a clock that follows its event loop, and an event loop that never waits.

Used by rehearsals and tests. Time jumps to the next timer as soon as nothing is left to do, so the same work
always happens at the same time.
"""

from __future__ import annotations

import asyncio
import selectors
from asyncio import AbstractEventLoop, Handle, SelectorEventLoop
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextvars import Context
from typing import Any, TypeVarTuple

Arguments = TypeVarTuple("Arguments")
EPOCH = 1_800_000_000.0  # Unix s at which simulated time begins


class LoopClock:
    """A fleet.clock.Clock that shows the time of an event loop."""

    def __init__(self, loop: AbstractEventLoop) -> None:
        self._loop = loop
        self._began = loop.time()

    def monotonic(self) -> float:
        """Return seconds that never jump."""
        return self._loop.time()

    def time(self) -> float:
        """Return Unix seconds, counted from a fixed epoch."""
        return EPOCH + self._loop.time() - self._began


class _JumpingSelector(selectors.DefaultSelector):
    """Selector that never waits: it advances the loop's time by the time-out instead."""

    def __init__(self) -> None:
        super().__init__()
        self.jumped = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Return the ready descriptors; if there are none, advance the time by the time-out."""
        ready = super().select(0)
        if ready or timeout is None:
            return ready or super().select(timeout)
        self.jumped += max(timeout, 0.0)
        return []


class _InlineExecutor(ThreadPoolExecutor):
    """Executor that makes blocking calls on the event loop's own thread: no time passes meanwhile."""

    def submit(self, call: Callable[..., Any], /, *arguments: Any, **more: Any) -> Future[Any]:
        """Make a call and return its result as a done future."""
        done: Future[Any] = Future()
        try:
            done.set_result(call(*arguments, **more))
        except Exception as error:  # noqa: BLE001 - passed on to the waiting task
            done.set_exception(error)
        return done


class JumpingLoop(SelectorEventLoop):
    """An event loop whose time jumps to the next timer as soon as nothing is left to do.

    Work for threads is done immediately (``_InlineExecutor``): no thread races with time.
    """

    def __init__(self) -> None:
        self._jumping = _JumpingSelector()
        super().__init__(self._jumping)
        self.set_default_executor(_InlineExecutor())

    def time(self) -> float:
        """Return the seconds skipped so far, from an arbitrary start."""
        return 1000.0 + self._jumping.jumped

    def call_soon_threadsafe(
        self,
        callback: Callable[[*Arguments], object],
        *arguments: *Arguments,
        context: Context | None = None,
    ) -> Handle:
        """Schedule a call from any thread; the loop's own thread need not wake it through a socket."""
        if asyncio._get_running_loop() is self:  # noqa: SLF001 - public, for event loops
            return self.call_soon(callback, *arguments, context=context)
        return super().call_soon_threadsafe(callback, *arguments, context=context)
