"""Links with recorded frames, which an adapter opens in a replay."""

from __future__ import annotations

from fleet.errors import LinkLost
from fleet.link.base import Address, LinkStats, Receiver
from fleet.link.link_end import LinkEnd
from fleet.link.tap import LinkFrame


class RecordedLink:
    """One open link; sent data is discarded."""

    def __init__(self, url: str, receiver: Receiver) -> None:
        self.url = url
        self.stats = LinkStats()
        self._receiver = receiver
        self._ending = LinkEnd(url)

    def fileno(self) -> int:
        """Return -1: there is no file to write to."""
        return -1

    def send(self, data: bytes, address: Address = None) -> bool:  # noqa: ARG002 - there is no peer
        """Discard the data; raises LinkLost after the end of the link."""
        if self._ending.ended:
            raise self._ending.error()
        self.stats.sent += 1
        return True

    def arrive(self, frame: LinkFrame) -> None:
        """Deliver a recorded frame."""
        if not self._ending.ended:
            self.stats.received += 1
            self._receiver(frame.data, _address(frame.peer))

    def fall(self, reason: str) -> None:
        """End the link."""
        self._ending.fall(reason)

    async def lost(self) -> None:
        """Wait until the link ends, then raise LinkLost."""
        await self._ending.wait()

    async def close(self) -> None:
        """Close; nothing is received after this returns."""
        self._ending.fall("closed")


class RecordedLinks:
    """The recorded links of one robot, by URL: opened by its adapter, fed by the replay."""

    def __init__(self, urls: tuple[str, ...]) -> None:
        self._urls = frozenset(urls)
        self._open: dict[str, RecordedLink] = {}

    async def open(self, url: str, receiver: Receiver) -> RecordedLink:
        """Open a link, in place of ``fleet.link.url.open_link``; raises LinkLost for one without frames."""
        if url not in self._urls:
            raise LinkLost(f"{url}: the recording has no frames of it")
        link = self._open[url] = RecordedLink(url, receiver)
        return link

    def deliver(self, url: str, frame: LinkFrame) -> None:
        """Deliver a received frame; when a link was reopened in the recording, end it first."""
        link = self._open.get(url)
        if link is not None and frame.direction == "in":
            link.arrive(frame)
        elif link is not None and frame.direction == "open" and link.stats.received:
            self._open.pop(url).fall("it was opened again then")


def _address(peer: str) -> Address:
    """Return the address of a datagram's peer, None for a stream."""
    host, _, port = peer.rpartition(":")
    return (host, int(port)) if host and port.isdecimal() else None
