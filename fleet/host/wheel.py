"""One timer for everything that is periodic in this process.

A wake-up costs ten times the work it does, so robots do not own timers: they hang on this wheel, which
turns every ``TICK`` seconds, and what they produced is flushed once at the end of a turn.
"""

from __future__ import annotations

import asyncio
import contextvars
import heapq
import itertools
import logging
from collections.abc import Callable

log = logging.getLogger(__name__)

TICK = 0.02  # s

OWNER: contextvars.ContextVar[str] = contextvars.ContextVar("owner", default="")
"""The robot on whose behalf code runs; every task that is started on its way inherits it."""


class Spoke:
    """One periodic call; ``cancel`` ends it."""

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


class Wheel:
    """The periodic calls of one event loop.

    ``owner`` names who is being called right now, so that whoever blocks the loop can be named; ``beat``
    is the loop time of the last turn.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._due: list[tuple[float, int, Spoke]] = []
        self._order = itertools.count()
        self._ends: list[Callable[[], None]] = []
        self._handle: asyncio.TimerHandle | None = None
        self.owner = ""
        self.beat = loop.time()

    def every(
        self, period: float, call: Callable[[], None], *, owner: str, failed: Callable[[Exception], None]
    ) -> Spoke:
        """Call about every ``period`` seconds; an exception goes to ``failed`` and ends it."""
        spoke = Spoke(owner, max(period, TICK), call, failed)
        heapq.heappush(self._due, (self._loop.time() + spoke.period, next(self._order), spoke))
        return spoke

    def at_end(self, call: Callable[[], None]) -> None:
        """Call at the end of every turn (flushing); must not raise."""
        self._ends.append(call)

    def start(self) -> None:
        """Begin to turn."""
        self.beat = self._loop.time()
        self._handle = self._loop.call_later(TICK, self._turn)

    def stop(self) -> None:
        """Stop turning."""
        if self._handle is not None:
            self._handle.cancel()

    def _turn(self) -> None:
        """Make the calls that are due, then flush."""
        now = self.beat = self._loop.time()
        self._handle = self._loop.call_at(now + TICK, self._turn)
        while self._due and self._due[0][0] <= now:
            due, _, spoke = heapq.heappop(self._due)
            if spoke.cancelled:
                continue
            self._call(spoke)
            if not spoke.cancelled:
                heapq.heappush(self._due, (_next_due(due, spoke.period, now), next(self._order), spoke))
        self.owner = ""
        for end in self._ends:
            _walled(end)

    def _call(self, spoke: Spoke) -> None:
        """Make one call, walled off."""
        self.owner = spoke.owner
        try:
            spoke.context.run(spoke.call)
        except Exception as error:  # noqa: BLE001 - the wall: one robot's fault must not stop the wheel
            spoke.cancel()
            spoke.failed(error)


def _next_due(due: float, period: float, now: float) -> float:
    """Return when a call that was due is due again: in step, after ``now``, without those it missed."""
    after = due + period * ((now - due) // period + 1)
    return after if after > now else after + period


def _walled(end: Callable[[], None]) -> None:
    """Make one call of a turn's end; the others are made whatever it raises."""
    try:
        end()
    except Exception:
        log.exception("the end of a turn failed")
