"""Notifications to systemd: the edge is ready, the supervisor is alive, the supervisor ends.

The protocol is sd_notify(3): one datagram of NAME=value lines to the socket in NOTIFY_SOCKET. Without a
service manager nothing is sent. A full or missing socket never delays a halt: the datagram is dropped.
"""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import MutableMapping

ADDRESS, WATCHDOG, WATCHED = "NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"
NOTIFICATIONS = 3.0  # notifications within one period of the watchdog: two may be lost


class ServiceManager:
    """Connection to the service manager, or none.

    It removes its variables from ``environ``, so that no child notifies in the name of the supervisor.
    ``every``: seconds between two watchdog notifications, 0 without a watchdog.
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
            self.every = int(period) / 1e6 / NOTIFICATIONS
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    @classmethod
    def of_this_process(cls) -> ServiceManager:
        """Return the service manager that started this process."""
        return cls(os.environ, os.getpid())

    def ready(self) -> None:
        """Report that the edge serves its robots."""
        self._send("READY=1\nSTATUS=the edge is running")

    def away(self, why: str) -> None:
        """Report that the edge has ended and will be restarted; ``why`` is one line."""
        self._send(f"STATUS={why.splitlines()[0] if why else ''}")

    def ending(self) -> None:
        """Report that the end was requested: robots are brought to a standstill first."""
        self._send("STOPPING=1\nSTATUS=robots are brought to a standstill")

    def alive(self, now: float) -> None:
        """Send a watchdog notification if one is due; ``now`` is monotonic seconds."""
        if self.every and now >= self._next:
            self._next = now + self.every
            self._send("WATCHDOG=1")

    def close(self) -> None:
        """Close the socket."""
        if self._socket is not None:
            self._socket.close()

    def _send(self, text: str) -> None:
        """Send lines, or drop them."""
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.sendto(text.encode(), self._address)
