"""A call that is made at most once in an interval, such as a write to the network."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable

from fleet.clock import Clock


class SpacedCall:
    """Makes a call immediately, but not within ``spacing`` seconds of the last ``mark``; on the loop.

    While a call is planned, further requests are merged with it. It refers to the callee only until the call:
    see ``_NextIterationCall``.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, clock: Clock, spacing: float) -> None:
        self.planned = False  # a planned call sees everything done before; any thread may read it
        self._loop = loop
        self._clock = clock
        self._spacing = spacing
        self._marked = -math.inf

    def __call__(self, call: Callable[[], None]) -> None:
        """Make the call now, or plan it."""
        if self.planned:
            return
        wait = self._marked + self._spacing - self._clock.monotonic()
        if wait <= 0:
            call()
        else:
            self.planned = True
            self._loop.call_later(wait, self._make, call)

    def mark(self, now: float) -> None:
        """Start an interval at ``now``, monotonic seconds."""
        self._marked = now

    def _make(self, call: Callable[[], None]) -> None:
        """Make the planned call. The flag is cleared first, so that a later request plans the next call."""
        self.planned = False
        call()
