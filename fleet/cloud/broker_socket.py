"""The broker's socket, plain or TLS, read and written without ever blocking.

asyncio's own transports belong to their loop alone; this one may be read by another thread while the loop is
stuck, so that an emergency stop is not.
"""

from __future__ import annotations

import asyncio
import contextlib
import select
import socket
import ssl
import threading
from collections.abc import Callable

from fleet.link.tcp import reset_on_close

MOST = 16384  # bytes of one read: a whole TLS record, of which TLS must keep nothing to itself

UNSENT = 16 * 1024
"""Bytes that wait in the kernel for the network at most.

Left to itself it takes megabytes: on a slow network states are seconds old when they leave, and what is
urgent, and pings, wait behind them.
"""

LATER = (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError)
"""What a socket raises that has nothing to give or no room now."""


def _closed() -> None:
    """Be called for room in a socket that is closed."""


class BrokerSocket:
    """A connected socket. Its calls are made one at a time: whoever has several threads holds a lock.

    It is made and closed on the loop, whatever thread calls the rest. The loop calls ``readable`` when
    something has arrived, and ``writable`` when there is room for what had to wait: ``write_rest`` then
    writes it.
    """

    def __init__(
        self, opened: socket.socket, readable: Callable[[], None], writable: Callable[[], None]
    ) -> None:
        # Without it replies wait 40 ms for one another's acknowledgement.
        opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, UNSENT)
        self.closed = False
        self._socket = opened
        self._writable = writable
        self._rest = bytearray()
        self._loop, self._thread = asyncio.get_running_loop(), threading.get_ident()
        self._poll = select.poll()
        self._poll.register(opened, select.POLLIN)
        self._loop.add_reader(opened.fileno(), readable)

    @property
    def full(self) -> bool:
        """True while bytes wait for room in the socket."""
        return bool(self._rest)

    def waiting(self) -> bool:
        """Tell whether there is something to read."""
        return not self.closed and bool(self._poll.poll(0))

    def read(self) -> bytes:
        """Return what has arrived, nothing when nothing has; raise OSError when the other side has ended."""
        try:
            data = self._socket.recv(MOST)
        except LATER:
            return b""
        if not data:
            raise ConnectionResetError("closed by the other side")
        return data

    def write(self, data: bytes) -> None:
        """Write, at once as far as the socket takes it; a connection that fell shows when it is read."""
        if self._rest:
            self._rest += data
        else:
            self._wait_for_room(data[self._send(data) :])

    def write_rest(self) -> None:
        """Write what had to wait, as far as the socket takes it now."""
        if self.closed:
            return
        del self._rest[: self._send(self._rest)]
        if not self._rest:
            self._loop.remove_writer(self._socket.fileno())

    def shut(self) -> None:
        """Tell the other side that nothing more comes; what has to wait for room is lost."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)

    def close(self, *, reset: bool = False) -> None:
        """Close; on the loop. ``reset``: with nothing left of it in the kernel, to arrive late."""
        if self.closed:
            return
        self.closed = True
        self._writable = _closed
        self._rest.clear()
        self._loop.remove_reader(self._socket.fileno())
        self._loop.remove_writer(self._socket.fileno())
        if reset:
            with contextlib.suppress(OSError):
                reset_on_close(self._socket)
        self._socket.close()

    def _send(self, data: bytes | bytearray) -> int:
        """Return how many bytes the socket took."""
        with memoryview(data) as view:
            sent = 0
            try:
                while sent < len(view):
                    sent += self._socket.send(view[sent:])
            except LATER:
                pass
            except OSError:
                sent = len(view)
            return sent

    def _wait_for_room(self, rest: bytes) -> None:
        """Keep what did not go out until the socket has room."""
        if not rest:
            return
        self._rest += rest
        if threading.get_ident() == self._thread:
            self._watch_for_room()
        else:
            with contextlib.suppress(RuntimeError):  # the loop has ended meanwhile
                self._loop.call_soon_threadsafe(self._watch_for_room)

    def _watch_for_room(self) -> None:
        """Have the loop tell of room; on the loop."""
        if self._rest and not self.closed:
            self._loop.add_writer(self._socket.fileno(), self._writable)
