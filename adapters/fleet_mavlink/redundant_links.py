"""Several links to the same vehicles, as one: what one of them loses, another still carries.

All of them are listened to and kept open; which of them a vehicle is spoken to by is decided for each
vehicle, by where it is heard.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Sequence
from functools import partial

import msgspec

from fleet import LinkLost, open_link
from fleet.errors import LinkError
from fleet.link.backoff import backoff
from fleet.link.base import Address, Link, Receiver

_LOG = logging.getLogger(__name__)
_LONGEST = 5.0  # s between attempts to open one again
_FIRST_WITHIN = 5.0  # s for the first of them to open


class Place(msgspec.Struct, frozen=True):
    """Who sent something: an address on one of the ways, 0 the one that is preferred."""

    way: int
    address: Address


def way_of(address: Address) -> int:
    """Return which way an address is on; 0 where there is one way alone."""
    return address.way if isinstance(address, Place) else 0


class Ways:
    """Some links that are kept open, each by itself; it never falls as a whole."""

    def __init__(self, urls: Sequence[str], receiver: Receiver) -> None:
        self.url = " + ".join(urls)
        self._receiver = receiver
        self._open: dict[int, Link] = {}
        self._news = asyncio.Event()
        self._keeping = [
            asyncio.create_task(self._keep(way, url), name=f"way {url}") for way, url in enumerate(urls)
        ]

    async def _keep(self, way: int, url: str) -> None:
        """Open one link, and again whenever it falls."""
        waits = backoff(longest=_LONGEST)
        while True:
            try:
                link = await open_link(url, partial(self._received, way))
                waits = backoff(longest=_LONGEST)
                self._open[way] = link
                self._news.set()
                try:
                    await link.lost()
                finally:
                    del self._open[way]
                    await link.close()
            except LinkError as error:
                _LOG.warning("%s: %s", url, error)
            await asyncio.sleep(next(waits))

    def _received(self, way: int, data: bytes, address: Address) -> None:
        """Pass on what came, with the way that it came by."""
        self._receiver(data, Place(way, address))

    async def first(self) -> None:
        """Wait until one of them is open; raises LinkLost."""
        try:
            async with asyncio.timeout(_FIRST_WITHIN):
                await self._news.wait()
        except TimeoutError:
            raise LinkLost(f"{self.url}: none of them could be opened") from None

    def fileno(self) -> int:
        """Return -1: several links have no one descriptor."""
        return -1

    def send(self, data: bytes, address: Address = None) -> None:
        """Write by the way of an address, by all of them without one.

        What is written while a way is down is lost, as it is in the air: it comes back by itself.
        """
        for way, link in tuple(self._open.items()):
            if address is None or address.way == way:
                with contextlib.suppress(LinkLost):
                    link.send(data, address.address if address is not None else None)

    async def lost(self) -> None:
        """Wait for ever: each way comes back by itself."""
        await asyncio.Event().wait()

    async def close(self) -> None:
        """Close them all."""
        for task in self._keeping:
            task.cancel()
        await asyncio.gather(*self._keeping, return_exceptions=True)


async def open_ways(urls: Sequence[str], receiver: Receiver) -> Link:
    """Open a link, or several as one; raises LinkRefused or LinkLost."""
    if len(urls) == 1:
        return await open_link(urls[0], receiver)
    ways = Ways(urls, receiver)
    try:
        await ways.first()
    except BaseException:
        await ways.close()
        raise
    return ways
