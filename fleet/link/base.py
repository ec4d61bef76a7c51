"""Link interface: carries bytes to and from one robot (or several on one port); knows no protocol."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

Address = Any  # (host, port) for datagrams; None for streams
Receiver = Callable[[bytes, Address], None]


class Link(Protocol):
    """An open link. Closing it twice is harmless."""

    url: str

    def fileno(self) -> int:
        """Return the file descriptor that ``send`` writes to, -1 for a link without one."""

    def send(self, data: bytes, address: Address = None) -> bool:
        """Write without blocking. Without an address, datagrams go to the sender of the last one received.

        May be called from any thread. Returns False for data that was dropped: there is no peer or no route
        yet, or a transmit queue is full. Raises LinkLost when the link is down.
        """

    async def lost(self) -> None:
        """Wait until the link goes down, then raise LinkLost with the reason."""

    async def close(self) -> None:
        """Close; nothing is received after this returns."""


class LinkStats:
    """Counters of one link, for health and ``fleet ps``."""

    def __init__(self) -> None:
        self.received = 0
        self.sent = 0
        self.dropped = 0
