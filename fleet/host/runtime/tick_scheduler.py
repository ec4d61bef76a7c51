"""Tick scheduler: one timer for all periodic work of this process.

A wake-up costs ten times as much as its work, so robots have no timers of their own: the scheduler runs every
``TICK`` seconds, and flushes their output once at the end of the tick. A tick runs in slices: a command that
arrives during it waits for one slice, not for fifty robots.
"""

from __future__ import annotations

import asyncio
import contextvars
import itertools
import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from fleet.clock import Clock
from fleet.runtime.exception_barrier import failure_of

log = logging.getLogger(__name__)

TICK = 0.02  # s
DUE_TOLERANCE = (
    1e-6  # s that a call may be early: sums of periods miss the loop's whole milliseconds by this much
)
SLICE = 0.00015  # s of work after which other callbacks of the loop get to run


class PeriodicCall:
    """One periodic call; ``cancel`` ends it."""

    __slots__ = ("call", "cancelled", "context", "failed", "failing", "owner", "period")

    def __init__(
        self,
        owner: str,
        period: float,
        call: Callable[[], None],
        failed: Callable[[Exception], None] | None,
    ) -> None:
        self.owner = owner
        self.period = period
        self.call = call
        self.failed = failed
        self.failing = False  # the last call failed, and the next is made nevertheless
        self.cancelled = False
        self.context = contextvars.copy_context()

    def cancel(self) -> None:
        """End it; no effect if it has ended."""
        self.cancelled = True


class TickScheduler:
    """Periodic calls of one event loop.

    ``owner`` is the robot whose call is running now, so that a blocking one can be named; ``beat`` is the
    time (monotonic s) of the last slice.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, clock: Clock) -> None:
        self._loop = loop
        self._clock = clock
        self._due: dict[int, deque[tuple[float, PeriodicCall]]] = {}  # by the tick in which they are due
        self._ends: list[Callable[[], Iterable[None]]] = []
        self._handle: asyncio.Handle | None = None
        self._work: Iterator[None] = iter(())
        self._stopped = False
        self.owner = ""
        self.beat = clock.monotonic()

    def every(
        self,
        period: float,
        call: Callable[[], None],
        *,
        owner: str = "",
        failed: Callable[[Exception], None] | None = None,
    ) -> PeriodicCall:
        """Call about every ``period`` seconds; an exception goes to ``failed`` and ends the calls.

        Without ``failed`` an exception is logged and the calls go on: the host's own work, such as repeats of
        a stop, must not end for good because it failed once.

        ``owner`` is the robot on whose behalf it is called, empty for the host's own work.
        """
        periodic = PeriodicCall(owner, max(period, TICK), call, failed)
        self._queue(self._loop.time() + periodic.period, periodic)
        return periodic

    def end(self, owner: str) -> None:
        """End all calls of a robot that this process no longer runs."""
        for _, periodic in itertools.chain.from_iterable(self._due.values()):
            if periodic.owner == owner:
                periodic.cancel()

    def at_end(self, call: Callable[[], Iterable[None]]) -> None:
        """Run ``call`` at the end of every tick (flushing), step by step; it must not raise."""
        self._ends.append(call)

    def start(self) -> None:
        """Start ticking."""
        self.beat = self._clock.monotonic()
        self._handle = self._loop.call_later(TICK, self._tick)

    def stop(self) -> None:
        """Stop ticking."""
        self._stopped = True
        if self._handle is not None:
            self._handle.cancel()

    def _tick(self) -> None:
        """Begin a tick."""
        now = self._loop.time()
        self._work = self._calls(now + DUE_TOLERANCE)
        self._yield_to_loop(now + TICK)

    def _run_slice(self, next_tick: float) -> None:
        """Do a slice of the tick, then yield to the loop; an exception does not end the ticking."""
        self.beat = self._clock.monotonic()
        end = self.beat + SLICE
        rest: tuple[Any, ...] = (self._loop.call_at, next_tick, self._tick)
        try:
            for _ in self._work:
                if self._clock.monotonic() >= end:
                    rest = (self._loop.call_soon, self._yield_to_loop, next_tick)
                    break
        finally:
            self._schedule(*rest)

    def _yield_to_loop(self, next_tick: float) -> None:
        """Let callbacks of data read after the last slice run before the next slice.

        Every slice is started from here, also the first: whatever the loop reads right after a slice is then
        queued before the next one. Data that arrive in the instant between wait for one slice.
        """
        self._schedule(self._loop.call_soon, self._run_slice, next_tick)

    def _schedule(self, how: Callable[..., asyncio.Handle], *arguments: object) -> None:
        """Schedule the next step, unless one of the calls stopped the scheduler."""
        self.owner = ""
        if not self._stopped:
            self._handle = how(*arguments)

    def _queue(self, due: float, periodic: PeriodicCall) -> None:
        """Queue a call for the first tick that is not before ``due``."""
        self._due.setdefault(int(due / TICK), deque()).append((due, periodic))

    def _calls(self, now: float) -> Iterator[None]:
        """Make the calls that are due, then flush, one per step; an interrupted tick leaves the rest due."""
        for tick in sorted(tick for tick in self._due if tick * TICK <= now):
            periodics = self._due[tick]
            for _ in range(len(periodics)):
                due, periodic = periodics.popleft()
                if due > now:
                    periodics.append((due, periodic))
                if due > now or periodic.cancelled:
                    continue
                self._call(periodic)
                if not periodic.cancelled:
                    self._queue(_next_due(due, periodic.period, now), periodic)
                yield
            if not periodics:
                del self._due[tick]
        self.owner = ""
        for end in self._ends:
            yield from _guarded(end)

    def _call(self, periodic: PeriodicCall) -> None:
        """Make one call; an exception is reported and ends at most this call."""
        self.owner = periodic.owner
        try:
            periodic.context.run(periodic.call)
            periodic.failing = False
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001 - exception barrier: one robot's fault must not stop the scheduler
            _report_failure(periodic, failure_of(error))


def _next_due(due: float, period: float, now: float) -> float:
    """Return the next due time of a call: in phase, after ``now``, skipping missed periods."""
    after = due + period * ((now - due) // period + 1)
    return after if after > now else after + period


def _report_failure(periodic: PeriodicCall, failure: Exception) -> None:
    """Report a failure, and end the call if it has ``failed``, whose own failure must not stop the scheduler.

    Of a call that fails again and again the first failure is logged.
    """
    if periodic.failed is None:
        if not periodic.failing:
            log.error("periodic work of the host failed; it is repeated", exc_info=failure)
        periodic.failing = True
        return
    periodic.cancel()
    try:
        periodic.failed(failure)
    except Exception:
        log.exception(
            "a timer of %s failed, and its error was not handled: %r", periodic.owner or "the host", failure
        )


def _guarded(end: Callable[[], Iterable[None]]) -> Iterator[None]:
    """Run one end-of-tick call behind an exception barrier, so that the others still run."""
    try:
        yield from end()
    except Exception:
        log.exception("the end of a turn failed")
