"""Write gate of the links of an edge of a pair: after the edge's lease has ended, nothing is written.

Before each write the gate reads the clock that also runs while the computer is suspended. So a process that
was frozen finds the gate closed on its first write. A link belongs to the epoch in which it was opened: a
later lease of the same edge does not reopen it.
"""

from __future__ import annotations

import contextvars
import math
import time
from collections.abc import Callable
from typing import Any

from fleet.errors import LinkLost
from fleet.link.base import Address, Link


def boot_time() -> float:
    """Return seconds since the start of the computer, including those in suspend."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


class LinkGate:
    """One process's gate: open in ``epoch`` until ``until`` (s of ``clock``). Any thread may set both."""

    def __init__(self, clock: Callable[[], float] = boot_time) -> None:
        self.epoch = 0
        self.until = -math.inf
        self._clock = clock

    def permits(self, epoch: int) -> bool:
        """Return whether a link of this epoch may be written to now."""
        return epoch != 0 and epoch == self.epoch and self._clock() < self.until

    def check(self, epoch: int, url: str) -> None:
        """Raise LinkLost unless a link of this epoch may be written to now."""
        if not self.permits(epoch):
            raise LinkLost(f"{url}: the lease of this edge has ended; the other edge of the pair may have it")


GATE: contextvars.ContextVar[LinkGate | None] = contextvars.ContextVar("gate", default=None)
"""The gate of links that are being opened; None for an edge that belongs to no pair."""


class GatedLink:
    """A link that can be written to only while its gate is open; otherwise it is the link itself."""

    def __init__(self, link: Link, gate: LinkGate, epoch: int) -> None:
        self.url = link.url
        self._link = link
        self._gate = gate
        self._epoch = epoch

    def send(self, data: bytes, address: Address = None) -> bool:
        """Write as the link does; raises LinkLost once the gate is closed."""
        self._gate.check(self._epoch, self.url)
        return self._link.send(data, address)

    def fileno(self) -> int:
        """Return the file descriptor that the link writes to."""
        return self._link.fileno()

    async def lost(self) -> None:
        """Wait until the link goes down, then raise LinkLost with the reason."""
        await self._link.lost()

    async def close(self) -> None:
        """Close the link."""
        await self._link.close()

    def __getattr__(self, name: str) -> Any:
        """Return an attribute that only some links have, such as ``unsent``."""
        return getattr(self._link, name)
