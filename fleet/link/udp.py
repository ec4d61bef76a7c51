"""Datagrams. The socket is written to directly, so a stop goes out even while the loop is stuck."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import socket
import threading
from typing import Any

from fleet.errors import LinkLost, LinkRefused
from fleet.link.base import Address, LinkStats, Receiver
from fleet.link.link_end import LinkEnd
from fleet.link.resolve import addresses_of

_LARGEST = 65535  # bytes, the largest datagram
_BATCH = 8  # datagrams taken per wake-up: a flood, or fifty robots at once, must not hold the loop


class UdpLink:
    """A datagram socket, bound (``udpin``) or connected (``udpout``).

    A datagram that cannot leave at once is dropped and counted, as is one to nobody: a datagram may be
    lost anywhere, and a motion that waited is worse than one that was lost. So this link never falls by
    itself; silence is for its user to notice.
    """

    def __init__(self, url: str, sock: socket.socket, receiver: Receiver, peer: Address = None) -> None:
        self.url = url
        self.stats = LinkStats()
        self._sock = sock
        self._receiver = receiver
        self._peer = peer
        self._learns = peer is None
        self._ending = LinkEnd(url)
        # Held for one system call: another thread must not write to a descriptor that was just reused.
        self._lock = threading.Lock()
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(sock, self._readable)

    def fileno(self) -> int:
        """Return the socket's descriptor, -1 once it is closed."""
        return self._sock.fileno()

    def send(self, data: bytes, address: Address = None) -> None:
        """Write one datagram to ``address``, or to whom was heard last; from any thread, never blocking."""
        target = address or self._peer
        with self._lock:
            if self._ending.ended:
                raise self._ending.error()
            # The refusal of an earlier datagram is told on this one, which is then not sent: once more.
            if target is not None and (self._sent(data, target) or self._sent(data, target)):
                self.stats.sent += 1
            else:
                self.stats.dropped += 1

    def _sent(self, data: bytes, target: Address) -> bool:
        """Return True when the kernel took the datagram."""
        try:
            if self._learns:
                self._sock.sendto(data, target)
            else:
                self._sock.send(data)
        except OSError:
            return False
        return True

    def _readable(self) -> None:
        """Pass on what has arrived."""
        for _ in range(_BATCH):
            try:
                data, address = self._sock.recvfrom(_LARGEST)
            except ConnectionRefusedError:
                continue  # ICMP: nobody listens there yet
            except OSError:
                return
            if self._learns:
                self._peer = address
            self.stats.received += 1
            self._receiver(data, address)
            if self._ending.ended:
                return

    async def lost(self) -> None:
        """Wait until the link is closed, then raise LinkLost."""
        await self._ending.wait()

    async def close(self) -> None:
        """Close; nothing is received after this returns."""
        with self._lock:
            if self._ending.ended:
                return
            self._ending.fall("closed")
            self._loop.remove_reader(self._sock)
            self._sock.close()


async def open_listening(url: str, host: str, port: int, receiver: Receiver) -> UdpLink:
    """Bind (port 0: any free one, told by ``link.url``) and answer whoever was heard last.

    Raises LinkRefused when the port is taken or the address is not this computer's.
    """
    family, _, address = (await addresses_of(url, host, port, socket.SOCK_DGRAM))[0]
    sock = _socket(family)
    try:
        # Without SO_REUSEADDR: a second listener would silently take the robot's datagrams away.
        sock.bind(address)
    except OSError as error:
        sock.close()
        raise LinkRefused(f"{url}: {_why_unbound(error)}") from None
    bound = sock.getsockname()[1]
    return UdpLink(f"{url.removesuffix(':0')}:{bound}" if port == 0 else url, sock, receiver)


async def open_speaking(url: str, host: str, port: int, receiver: Receiver) -> UdpLink:
    """Send to one address, and hear only it; raises LinkLost when there is no way to it now."""
    family, _, address = (await addresses_of(url, host, port, socket.SOCK_DGRAM))[0]
    sock = _socket(family)
    try:
        sock.connect(address)
    except OSError as error:
        sock.close()
        raise LinkLost(f"{url}: {error.strerror}") from None
    return UdpLink(url, sock, receiver, peer=address)


def _socket(family: Any) -> socket.socket:
    """Return a datagram socket that never blocks, with room for a burst of telemetry."""
    sock = socket.socket(family, socket.SOCK_DGRAM)
    sock.setblocking(False)
    with contextlib.suppress(OSError):
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    return sock


_UNBOUND = {
    errno.EADDRINUSE: "the port is taken; stop the program that holds it or use another port",
    errno.EADDRNOTAVAIL: "this computer has no such address; 0.0.0.0 listens on all of them",
    errno.EACCES: "ports below 1024 need more rights; use a higher port",
}


def _why_unbound(error: OSError) -> str:
    """Say why the address cannot be listened on, and what to do."""
    return _UNBOUND.get(error.errno or 0, str(error.strerror))
