"""What the supervisor tells systemd: that the edge is ready, that the supervisor is alive, that it ends.

The protocol is sd_notify(3): one datagram of  NAME=value  lines to the socket in NOTIFY_SOCKET. Without a
service manager nothing is sent. A full or missing socket never delays a halt: the datagram is dropped.
"""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import MutableMapping

ADDRESS, WATCHDOG, WATCHED = "NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"
SIGNS = 3.0  # signs of life within one period of the watchdog: two may be lost


class ServiceManager:
    """The service manager, or none.

    Takes its variables out of ``environ``, so that no child answers in the name of the supervisor. ``every``:
    seconds between two signs of life, 0 where nobody watches.
    """

    def __init__(self, environ: MutableMapping[str, str], process: int) -> None:
        address = environ.pop(ADDRESS, "")
        period, watched = environ.pop(WATCHDOG, ""), environ.pop(WATCHED, "")
        self.every = 0.0
        self._next = 0.0
        self._socket: socket.socket | None = None
        if not address:
            return
        if period.isdecimal() and watched in ("", str(process)):
            self.every = int(period) / 1e6 / SIGNS
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    @classmethod
    def of_this_process(cls) -> ServiceManager:
        """Return the one that started this process."""
        return cls(os.environ, os.getpid())

    def ready(self) -> None:
        """Report that the edge serves its robots."""
        self._send("READY=1\nSTATUS=the edge is running")

    def away(self, why: str) -> None:
        """Report that the edge has ended and is started again; ``why`` is one line."""
        self._send(f"STATUS={why.splitlines()[0] if why else ''}")

    def ending(self) -> None:
        """Report that the end was requested: robots are brought to a standstill first."""
        self._send("STOPPING=1\nSTATUS=robots are brought to a standstill")

    def alive(self, now: float) -> None:
        """Give a sign of life when one is due; ``now`` is monotonic seconds."""
        if self.every and now >= self._next:
            self._next = now + self.every
            self._send("WATCHDOG=1")

    def close(self) -> None:
        """Say no more."""
        if self._socket is not None:
            self._socket.close()

    def _send(self, text: str) -> None:
        """Send lines, or drop them."""
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.sendto(text.encode(), self._address)
