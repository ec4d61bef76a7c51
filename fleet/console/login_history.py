"""Logins in the history of the edge beside the console: successful and failed ones.

Failures are limited per minute: trying passwords must not push the robots' events out of the history.
"""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import msgspec

from fleet.clock import Clock
from fleet.history.store import History, HistoryBounds
from fleet.model.command import Transport
from fleet.model.event import EventKind, EventReport, Requester, Severity

WRITE_EVERY = 0.5  # s
FAILURES, WINDOW = 20, 60.0  # failures written in so many seconds


class HistoryPlace(msgspec.Struct, frozen=True):
    """Location and limits of the edge's history: ``size`` in bytes, ``age`` in seconds."""

    folder: str
    size: int
    age: float


class LoginHistory:
    """Collects logins on the loop; ``run`` writes them on a thread."""

    def __init__(self, place: HistoryPlace, clock: Clock) -> None:
        self._history = History(Path(place.folder), clock, HistoryBounds(place.size, place.age))
        self._clock = clock
        self._window, self._failed, self._unrecorded = float("-inf"), 0, 0

    def logged_in(self, name: str, address: str) -> None:
        """Record a successful login."""
        requester = Requester(Transport.LOCAL, name, proven=True)
        self._add(f"{name} logged in at the console, from {address}", Severity.INFO, requester, address)

    def failed(self, name: str, address: str, wait: float) -> None:
        """Record a failed login; ``name`` is empty if it is unknown, because it may be a password."""
        now = self._clock.monotonic()
        if now - self._window >= WINDOW:
            self._window, self._failed = now, 0
        self._failed += 1
        if self._failed > FAILURES:
            self._unrecorded += 1
            return
        whom = f"as {name}" if name else "with an unknown name"
        later = f"; the next try waits {wait:.0f} s" if wait else ""
        more = f"; {self._unrecorded} failures before were not written" if self._unrecorded else ""
        self._unrecorded = 0
        requester = Requester(Transport.LOCAL, name)
        text = f"a login at the console {whom} failed, from {address}{later}{more}"
        self._add(text, Severity.WARNING, requester, address)

    async def run(self) -> None:
        """Write new events until cancelled, and a last time then."""
        loop = asyncio.get_running_loop()
        with ThreadPoolExecutor(1, thread_name_prefix="login-history") as thread:
            try:
                while True:
                    await asyncio.sleep(WRITE_EVERY)
                    await loop.run_in_executor(thread, self._history.write)
            finally:
                thread.submit(self._history.close)  # the end of the block waits for it

    def _add(self, text: str, severity: Severity, requester: Requester, address: str) -> None:
        """Add an event of the edge."""
        event = EventReport(
            self._clock.time(), EventKind.LOGIN, text, severity, requester, data={"address": address}
        )
        self._history.add("", event)
