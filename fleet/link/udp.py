"""UDP links. Sends write to the socket directly, so a stop goes out even while the loop is blocked."""

from __future__ import annotations

import asyncio
import contextlib
import contextvars
import errno
import socket
import threading
from typing import Any

from fleet.errors import LinkLost, LinkRefused
from fleet.link.base import Address, LinkStats, Receiver
from fleet.link.link_end import LinkEnd
from fleet.link.resolve import addresses_of
from fleet.link.tap import tap_of

_LARGEST = 65535  # bytes, the largest datagram
_BATCH = 8  # datagrams read per wake-up: a flood, or fifty robots at once, must not block the loop


class UdpLink:
    """A datagram socket, bound (``udpin``) or connected (``udpout``).

    A datagram that cannot be sent at once, or that has no known peer, is dropped and counted: any datagram
    may be lost on the way, and delayed motion is worse than lost motion. So this link never goes down by
    itself; its user must notice silence.
    """

    def __init__(self, url: str, sock: socket.socket, receiver: Receiver, peer: Address = None) -> None:
        self.url = url
        self.stats = LinkStats()
        self._sock = sock
        self._receiver = receiver
        self._peer = peer
        self._learns = peer is None
        self._ending = LinkEnd(url)
        self._tap = tap_of(url)
        # Held for one system call: a thread must not write to a descriptor that was closed and then reused.
        self._lock = threading.Lock()
        self._loop = asyncio.get_running_loop()
        self._context = contextvars.copy_context()
        self._listen()

    def _listen(self) -> None:
        """Read what arrives from now on, on behalf of the robot that opened the link."""
        self._context.run(self._loop.add_reader, self._sock, self._readable)

    def _listen_again(self) -> None:
        """Read on after an error of the socket: libuv stops watching a descriptor that had one."""
        if not self._ending.ended:
            self._loop.remove_reader(self._sock)
            self._listen()

    def fileno(self) -> int:
        """Return the socket's descriptor, -1 once it is closed."""
        return self._sock.fileno()

    def send(self, data: bytes, address: Address = None) -> bool:
        """Write one datagram to ``address``, or to the last sender; from any thread, without blocking."""
        target = address or self._peer
        with self._lock:
            if self._ending.ended:
                raise self._ending.error()
            # The kernel reports the ICMP error of an earlier datagram on this send, and does not send this
            # datagram: so try a second time.
            if target is not None and (self._sent(data, target) or self._sent(data, target)):
                self.stats.sent += 1
                if (note := self._tap.note) is not None:
                    note("out", data, target)
                return True
            self.stats.dropped += 1
            return False

    def _sent(self, data: bytes, target: Address) -> bool:
        """Send a datagram; return True when the kernel accepted it."""
        try:
            if self._learns:
                self._sock.sendto(data, target)
            else:
                self._sock.send(data)
        except ConnectionRefusedError:
            with contextlib.suppress(RuntimeError):  # the loop is closed
                self._loop.call_soon_threadsafe(self._listen_again)
            return False
        except OSError:
            return False
        return True

    def _readable(self) -> None:
        """Read received datagrams and pass them to the receiver."""
        for _ in range(_BATCH):
            try:
                data, address = self._sock.recvfrom(_LARGEST)
            except ConnectionRefusedError:
                self._listen_again()  # ICMP error of an earlier send: nobody listens there yet
                continue
            except OSError:
                return
            if self._learns:
                self._peer = address
            self.stats.received += 1
            if (note := self._tap.note) is not None:
                note("in", data, address)
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
    """Bind (port 0: any free port; see ``link.url``) and send to the sender of the last datagram.

    Raises LinkRefused when the port is in use or the address is not one of this computer.
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
    """Send to one address and receive only from it; raises LinkLost when it has no route now."""
    family, _, address = (await addresses_of(url, host, port, socket.SOCK_DGRAM))[0]
    sock = _socket(family)
    try:
        sock.connect(address)
    except OSError as error:
        sock.close()
        raise LinkLost(f"{url}: {error.strerror}") from None
    return UdpLink(url, sock, receiver, peer=address)


def _socket(family: Any) -> socket.socket:
    """Return a non-blocking datagram socket with a receive buffer for a burst of telemetry."""
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
    """Return why the address cannot be bound, and what to do."""
    return _UNBOUND.get(error.errno or 0, str(error.strerror))
