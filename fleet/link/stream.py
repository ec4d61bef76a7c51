"""A stream of bytes over one file descriptor; what TCP and serial have in common.

The descriptor is written to directly, so a stop goes out even while the loop is stuck. What the robot
has not taken waits in the kernel, where it cannot be recalled: it is motion that arrives late. So the
backlog has a limit, and beyond it the link counts as fallen rather than growing older.
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

_PIECE = 65536  # bytes taken per wake-up
CloseDescriptor = Callable[[bool], None]  # True: throw away what is not yet sent


class StreamLink:
    """An open stream; ``backlog`` is how many bytes may wait in the kernel.

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
        # Held for one system call: another thread must not write to a descriptor that was just reused.
        self._lock = threading.Lock()
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(descriptor, self._readable)

    def fileno(self) -> int:
        """Return the descriptor that is written to."""
        return self._descriptor

    def send(self, data: bytes, address: Address = None) -> None:  # noqa: ARG002 - streams have one peer
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

    def unsent(self) -> int:
        """Return how many bytes wait in the kernel, 0 once the link ended; from any thread."""
        with self._lock:
            if self._ending.ended:
                return 0
            try:
                return _unsent(self._descriptor)
            except OSError as error:  # an unplugged device, before the loop has noticed it
                self._ending.fall(str(error.strerror or error))
                return 0

    def _write(self, data: bytes) -> None:
        """Hand the bytes to the kernel; half a frame cannot be taken back, so it ends the link."""
        waiting = _unsent(self._descriptor)
        if waiting > self._backlog:
            raise self._ending.fall(f"the robot does not read: {waiting} bytes wait for it")
        try:
            taken = os.write(self._descriptor, data)
        except BlockingIOError:
            taken = 0
        if taken < len(data):
            raise self._ending.fall("the robot does not read: the way to it is full")

    def _readable(self) -> None:
        """Pass on what has arrived, or notice the end."""
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
        self._receiver(data, None)

    def _fall(self, reason: str) -> None:
        """Note the end and stop listening to a descriptor that would stay readable for ever."""
        self._loop.remove_reader(self._descriptor)
        self._ending.fall(reason)

    async def lost(self) -> None:
        """Wait until the link falls, then raise LinkLost with the reason."""
        await self._ending.wait()

    async def close(self) -> None:
        """Close; nothing is received after this returns. After a fall, what was not sent is thrown away."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            fallen = self._ending.ended
            self._ending.fall("closed")
            self._loop.remove_reader(self._descriptor)
        await asyncio.shield(asyncio.to_thread(self._close_descriptor, fallen))


def _unsent(descriptor: int) -> int:
    """Return how many bytes wait in the kernel (TIOCOUTQ; for a TCP socket: not yet acknowledged)."""
    count = array.array("i", [0])
    fcntl.ioctl(descriptor, termios.TIOCOUTQ, count)
    return count[0]
