"""Byte stream over one file descriptor: the common part of TCP and serial links.

Sends write to the descriptor directly, so a stop goes out even while the event loop is blocked. Bytes that
the robot has not read wait in the kernel, where they cannot be recalled: they are motion that arrives late.
So the backlog is limited, and a link that exceeds it counts as down.
"""

from __future__ import annotations

import array
import asyncio
import fcntl
import os
import termios
import threading
from collections.abc import Callable

from fleet.errors import LinkLost
from fleet.link.base import Address, LinkStats, Receiver
from fleet.link.link_end import LinkEnd
from fleet.link.tap import tap_of

_PIECE = 65536  # bytes read per wake-up
CloseDescriptor = Callable[[bool], None]  # True: discard unsent bytes


class StreamLink:
    """An open stream; ``backlog`` is the number of bytes that may wait in the kernel.

    ``close_descriptor`` may block and is called once, on a thread.
    """

    def __init__(
        self,
        url: str,
        descriptor: int,
        receiver: Receiver,
        *,
        backlog: int,
        close_descriptor: CloseDescriptor,
    ) -> None:
        self.url = url
        self.stats = LinkStats()
        self._descriptor = descriptor
        self._receiver = receiver
        self._backlog = backlog
        self._close_descriptor = close_descriptor
        self._closed = False
        self._ending = LinkEnd(url)
        self._tap = tap_of(url)
        # Held for one system call: a thread must not write to a descriptor that was closed and then reused.
        self._lock = threading.Lock()
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(descriptor, self._readable)

    def fileno(self) -> int:
        """Return the file descriptor that ``send`` writes to."""
        return self._descriptor

    def send(self, data: bytes, address: Address = None) -> bool:  # noqa: ARG002 - streams have one peer
        """Write all of ``data`` or raise LinkLost; from any thread, never blocking."""
        with self._lock:
            if self._ending.ended:
                raise self._ending.error()
            try:
                self._write(data)
            except OSError as error:
                raise self._ending.fall(str(error.strerror or error)) from None
            except LinkLost:
                self.stats.dropped += 1
                raise
            self.stats.sent += 1
            if (note := self._tap.note) is not None:
                note("out", data)
            return True

    def unsent(self) -> int:
        """Return the number of bytes that wait in the kernel, 0 once the link has ended; from any thread."""
        with self._lock:
            if self._ending.ended:
                return 0
            try:
                return _unsent(self._descriptor)
            except OSError as error:  # the device was unplugged, and the loop has not noticed yet
                self._ending.fall(str(error.strerror or error))
                return 0

    def _write(self, data: bytes) -> None:
        """Hand the bytes to the kernel. A partial write ends the link: half a frame cannot be taken back."""
        waiting = _unsent(self._descriptor)
        if waiting > self._backlog:
            raise self._ending.fall(f"the robot does not read: {waiting} bytes wait for it")
        try:
            taken = os.write(self._descriptor, data)
        except BlockingIOError:
            taken = 0
        if taken < len(data):
            raise self._ending.fall("the robot does not read: its transmit buffer is full")

    def _readable(self) -> None:
        """Read received bytes and pass them to the receiver, or record the end of the stream."""
        try:
            data = os.read(self._descriptor, _PIECE)
        except (BlockingIOError, InterruptedError):
            return
        except OSError as error:
            self._fall(str(error.strerror or error))
            return
        if not data:
            self._fall("the other side closed it")
            return
        self.stats.received += 1
        if (note := self._tap.note) is not None:
            note("in", data)
        self._receiver(data, None)

    def _fall(self, reason: str) -> None:
        """Record the end, and remove the reader: a dead descriptor stays readable for ever."""
        self._loop.remove_reader(self._descriptor)
        self._ending.fall(reason)

    async def lost(self) -> None:
        """Wait until the link goes down, then raise LinkLost with the reason."""
        await self._ending.wait()

    async def close(self) -> None:
        """Close; nothing is received after this returns. A link that is down discards its unsent bytes."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            fallen = self._ending.ended
            self._ending.fall("closed")
            self._loop.remove_reader(self._descriptor)
        await asyncio.shield(asyncio.to_thread(self._close_descriptor, fallen))


def _unsent(descriptor: int) -> int:
    """Return the number of bytes that wait in the kernel (TIOCOUTQ; on a TCP socket: unacknowledged)."""
    count = array.array("i", [0])
    fcntl.ioctl(descriptor, termios.TIOCOUTQ, count)
    return count[0]
