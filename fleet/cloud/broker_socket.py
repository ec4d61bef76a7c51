"""Non-blocking socket of the broker connection, plain or TLS.

The transports of asyncio belong to their loop. This socket may also be read by another thread, so that an
emergency stop is read while the loop is stuck.
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

MOST = 16384  # bytes of one read: one whole TLS record, so nothing stays buffered in OpenSSL

UNSENT = 16 * 1024
"""Limit of unsent bytes in the kernel (TCP_NOTSENT_LOWAT).

The default is megabytes: on a slow network, states would be seconds old when they leave, and urgent messages
and pings would wait behind them.
"""

WOULD_BLOCK = (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError)
"""Exceptions of a socket that has no data, or no room, at the moment."""


def _closed() -> None:
    """Do nothing: the ``writable`` callback of a closed socket."""


class BrokerSocket:
    """A connected socket. Calls are not concurrent: with several threads, the caller holds a lock.

    It is created and closed on the loop; any thread may make the other calls. The loop calls ``readable``
    when data has arrived, and ``writable`` when the socket has room for buffered data, which ``write_rest``
    then writes.
    """

    def __init__(
        self, opened: socket.socket, readable: Callable[[], None], writable: Callable[[], None]
    ) -> None:
        # With Nagle's algorithm, a reply waits up to 40 ms for the delayed acknowledgement of the one before.
        opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, UNSENT)
        self.closed = False
        self._socket = opened
        self._writable = writable
        self._unsent = bytearray()
        self._loop, self._thread = asyncio.get_running_loop(), threading.get_ident()
        self._poll = select.poll()
        self._poll.register(opened, select.POLLIN)
        self._loop.add_reader(opened.fileno(), readable)

    @property
    def full(self) -> bool:
        """True while buffered data waits for room in the socket."""
        return bool(self._unsent)

    def waiting(self) -> bool:
        """Return whether there is data to read."""
        return not self.closed and bool(self._poll.poll(0))

    def read(self) -> bytes:
        """Return the data that has arrived, empty if none; raise OSError when the peer has closed."""
        try:
            data = self._socket.recv(MOST)
        except WOULD_BLOCK:
            return b""
        if not data:
            raise ConnectionResetError("closed by the other side")
        return data

    def write(self, data: bytes) -> None:
        """Write as much as the socket takes and buffer the rest; a lost connection shows on the next read."""
        if self._unsent:
            self._unsent += data
        else:
            self._wait_for_room(data[self._send(data) :])

    def write_rest(self) -> None:
        """Write as much of the buffered data as the socket takes."""
        if self.closed:
            return
        del self._unsent[: self._send(self._unsent)]
        if not self._unsent:
            self._loop.remove_writer(self._socket.fileno())

    def close_write(self) -> None:
        """Close the sending side; buffered data is lost."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)

    def close(self, *, reset: bool = False) -> None:
        """Close; on the loop.

        ``reset``: discard unsent data in the kernel, so that it does not arrive late.
        """
        if self.closed:
            return
        self.closed = True
        self._writable = _closed
        self._unsent.clear()
        self._loop.remove_reader(self._socket.fileno())
        self._loop.remove_writer(self._socket.fileno())
        if reset:
            with contextlib.suppress(OSError):
                reset_on_close(self._socket)
        self._socket.close()

    def _send(self, data: bytes | bytearray) -> int:
        """Return the number of bytes that the socket took."""
        with memoryview(data) as view:
            sent = 0
            try:
                while sent < len(view):
                    sent += self._socket.send(view[sent:])
            except WOULD_BLOCK:
                pass
            except OSError:
                sent = len(view)
            return sent

    def _wait_for_room(self, rest: bytes) -> None:
        """Buffer unsent data until the socket has room."""
        if not rest:
            return
        self._unsent += rest
        if threading.get_ident() == self._thread:
            self._watch_for_room()
        else:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._watch_for_room)

    def _watch_for_room(self) -> None:
        """Register the ``writable`` callback; on the loop."""
        if self._unsent and not self.closed:
            self._loop.add_writer(self._socket.fileno(), self._writable)
