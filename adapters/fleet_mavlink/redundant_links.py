"""Redundant links to the same vehicles, combined into one link.

All links are kept open and received from. The link for sending is selected per vehicle, by where the vehicle
is heard.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Sequence
from functools import partial

import msgspec

from fleet import Address, Link, LinkError, LinkLost, Receiver, backoff, open_link

_LOG = logging.getLogger(__name__)
_LONGEST = 5.0  # s, longest delay between attempts to reopen a link
_FIRST_WITHIN = 5.0  # s within which the first link must open


class LinkAddress(msgspec.Struct, frozen=True):
    """Sender of a message: an address on one of the links; link 0 is preferred."""

    index: int
    address: Address


def link_index_of(address: Address) -> int:
    """Return the number of the link of an address; 0 with a single link."""
    return address.index if isinstance(address, LinkAddress) else 0


class RedundantLinks:
    """Several links, each reopened independently; the combination is never lost."""

    def __init__(self, urls: Sequence[str], receiver: Receiver) -> None:
        self.url = " + ".join(urls)
        self._receiver = receiver
        self._open: dict[int, Link] = {}
        self._wakeup = asyncio.Event()
        self._keeping = [
            asyncio.create_task(self._keep(index, url), name=f"way {url}") for index, url in enumerate(urls)
        ]

    async def _keep(self, index: int, url: str) -> None:
        """Open one link, and reopen it after each loss."""
        waits = backoff(longest=_LONGEST)
        while True:
            try:
                link = await open_link(url, partial(self._received, index))
                waits = backoff(longest=_LONGEST)
                self._open[index] = link
                self._wakeup.set()
                try:
                    await link.lost()
                finally:
                    del self._open[index]
                    await link.close()
            except LinkError as error:
                _LOG.warning("%s: %s", url, error)
            await asyncio.sleep(next(waits))

    def _received(self, index: int, data: bytes, address: Address) -> None:
        """Pass received data on, with the number of its link."""
        self._receiver(data, LinkAddress(index, address))

    async def first(self) -> None:
        """Wait until one of them is open; raises LinkLost."""
        try:
            async with asyncio.timeout(_FIRST_WITHIN):
                await self._wakeup.wait()
        except TimeoutError:
            raise LinkLost(f"{self.url}: none of them could be opened") from None

    def fileno(self) -> int:
        """Return -1: several links have no single descriptor."""
        return -1

    def send(self, data: bytes, address: Address = None) -> bool:
        """Write to the link of an address, or to all links without one.

        Data written while a link is down is lost, as on a radio link; the link is reopened by itself.
        """
        written = False
        for index, link in tuple(self._open.items()):
            if address is None or address.index == index:
                with contextlib.suppress(LinkLost):
                    written |= link.send(data, address.address if address is not None else None)
        return written

    async def lost(self) -> None:
        """Wait forever: each link reopens automatically."""
        await asyncio.Event().wait()

    async def close(self) -> None:
        """Close all links."""
        for task in self._keeping:
            task.cancel()
        await asyncio.gather(*self._keeping, return_exceptions=True)


async def open_links(urls: Sequence[str], receiver: Receiver) -> Link:
    """Open a link, or several as one; raises LinkRefused or LinkLost."""
    if len(urls) == 1:
        return await open_link(urls[0], receiver)
    links = RedundantLinks(urls, receiver)
    try:
        await links.first()
    except BaseException:
        await links.close()
        raise
    return links
