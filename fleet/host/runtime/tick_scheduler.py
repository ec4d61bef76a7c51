"""One timer for everything that is periodic in this process.

A wake-up costs ten times the work it does, so robots do not own timers: they hang on this wheel, which
turns every ``TICK`` seconds, and what they produced is flushed once at the end of a turn. A turn is done in
slices: a command that arrives in the middle of it waits for a slice, not for fifty robots.
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
    1e-6  # s that a call may be early: sums of periods miss the loop's whole milliseconds by as little
)
SLICE = 0.00015  # s of work after which whatever else waits for the loop has its turn


def log_failure(error: Exception) -> None:
    """Tell of the host's own periodic work, which is not expected to fail."""
    log.error("a timer of the host's own failed", exc_info=error)


class PeriodicCall:
    """One periodic call; ``cancel`` ends it."""

    __slots__ = ("call", "cancelled", "context", "failed", "owner", "period")

    def __init__(
        self, owner: str, period: float, call: Callable[[], None], failed: Callable[[Exception], None]
    ) -> None:
        self.owner = owner
        self.period = period
        self.call = call
        self.failed = failed
        self.cancelled = False
        self.context = contextvars.copy_context()

    def cancel(self) -> None:
        """End it; harmless when it has ended."""
        self.cancelled = True


class TickScheduler:
    """The periodic calls of one event loop.

    ``owner`` names who is being called right now, so that whoever blocks the loop can be named; ``beat``
    is when (monotonic) it last had the loop.
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
        failed: Callable[[Exception], None] = log_failure,
    ) -> PeriodicCall:
        """Call about every ``period`` seconds; whatever it raises goes to ``failed`` and ends it.

        ``owner`` is the robot on whose behalf it is, empty for the host's own work.
        """
        periodic = PeriodicCall(owner, max(period, TICK), call, failed)
        self._hang(self._loop.time() + periodic.period, periodic)
        return periodic

    def end(self, owner: str) -> None:
        """End all calls on behalf of a robot: the process does not run it any more."""
        for _, periodic in itertools.chain.from_iterable(self._due.values()):
            if periodic.owner == owner:
                periodic.cancel()

    def at_end(self, call: Callable[[], Iterable[None]]) -> None:
        """Carry out at the end of every turn (flushing), step by step; must not raise."""
        self._ends.append(call)

    def start(self) -> None:
        """Begin to turn."""
        self.beat = self._clock.monotonic()
        self._handle = self._loop.call_later(TICK, self._turn)

    def stop(self) -> None:
        """Stop turning."""
        self._stopped = True
        if self._handle is not None:
            self._handle.cancel()

    def _turn(self) -> None:
        """Begin a turn."""
        now = self._loop.time()
        self._work = self._calls(now + DUE_TOLERANCE)
        self._give_way(now + TICK)

    def _go_on(self, next_turn: float) -> None:
        """Do a slice of the turn, then leave the loop to others; there is a next one whatever it raises."""
        self.beat = self._clock.monotonic()
        end = self.beat + SLICE
        rest: tuple[Any, ...] = (self._loop.call_at, next_turn, self._turn)
        try:
            for _ in self._work:
                if self._clock.monotonic() >= end:
                    rest = (self._loop.call_soon, self._give_way, next_turn)
                    break
        finally:
            self._schedule(*rest)

    def _give_way(self, next_turn: float) -> None:
        """Let what was read after the last slice begin before the next one.

        That is why every slice begins from here, the first too: what the loop reads as soon as one is done
        then stands in its queue before the next. What comes in the instant between waits for one slice.
        """
        self._schedule(self._loop.call_soon, self._go_on, next_turn)

    def _schedule(self, how: Callable[..., asyncio.Handle], *arguments: object) -> None:
        """Go on later, unless one of the calls stopped the wheel."""
        self.owner = ""
        if not self._stopped:
            self._handle = how(*arguments)

    def _hang(self, due: float, periodic: PeriodicCall) -> None:
        """Have a call made in the first turn that is not before ``due``."""
        self._due.setdefault(int(due / TICK), deque()).append((due, periodic))

    def _calls(self, now: float) -> Iterator[None]:
        """Make the calls that are due, then flush, one by one; what is left off half-way is still due."""
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
                    self._hang(_next_due(due, periodic.period, now), periodic)
                yield
            if not periodics:
                del self._due[tick]
        self.owner = ""
        for end in self._ends:
            yield from _walled(end)

    def _call(self, periodic: PeriodicCall) -> None:
        """Make one call; what it raises is reported and ends only this call."""
        self.owner = periodic.owner
        try:
            periodic.context.run(periodic.call)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001 - the wall: one robot's fault must not stop the wheel
            periodic.cancel()
            _tell(periodic, failure_of(error))


def _next_due(due: float, period: float, now: float) -> float:
    """Return when a call that was due is due again: in step, after ``now``, without those it missed."""
    after = due + period * ((now - due) // period + 1)
    return after if after > now else after + period


def _tell(periodic: PeriodicCall, failure: Exception) -> None:
    """Tell of a failure; who cannot take it must not stop the wheel either."""
    try:
        periodic.failed(failure)
    except Exception:
        log.exception("a timer of %s failed, and nobody took it: %r", periodic.owner or "the host", failure)


def _walled(end: Callable[[], Iterable[None]]) -> Iterator[None]:
    """Carry out one of a turn's ends; the others are carried out whatever it raises."""
    try:
        yield from end()
    except Exception:
        log.exception("the end of a turn failed")
