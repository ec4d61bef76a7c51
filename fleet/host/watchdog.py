"""The watchdog thread: ends velocities whose lease ran out, and names whoever blocks the event loop.

It shares nothing with the loop but the leases, so it works while the loop is stuck.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

import msgspec

from fleet.clock import Clock
from fleet.host.safety.deadman import DeadMan

log = logging.getLogger(__name__)

PERIOD = 0.02  # s between looks; the most that a stop can be late
BLOCKED = 0.25  # s without a turn of the wheel after which the loop counts as blocked
STUCK = 10.0  # s after which the process is given up


class Watched(msgspec.Struct, frozen=True):
    """One robot under watch; ``halt`` is called on this thread, ``expired`` must hand over to the loop."""

    deadman: DeadMan
    halt: Callable[[], None]
    expired: Callable[[], None]


class LoopWatch(msgspec.Struct, frozen=True):
    """How the watchdog sees the loop: its last beat (monotonic s), who runs now, and what to do.

    ``blocked`` gets the name and the seconds, once per block; ``stuck`` is the last resort.
    """

    beat: Callable[[], float]
    running: Callable[[], str]
    blocked: Callable[[str, float], None]
    stuck: Callable[[str], None]


class Watchdog:
    """The thread; robots are added and removed while it runs."""

    def __init__(self, clock: Clock, loop: LoopWatch) -> None:
        self._clock = clock
        self._loop = loop
        self._robots: dict[str, Watched] = {}
        self._ended = threading.Event()
        self._named = ""
        self._thread = threading.Thread(target=self._run, name="fleet-watchdog", daemon=True)

    def start(self) -> None:
        """Begin to watch."""
        self._thread.start()

    def stop(self) -> None:
        """End; returns when the thread has ended."""
        self._ended.set()
        self._thread.join(timeout=1.0)

    def add(self, name: str, watched: Watched) -> None:
        """Watch a robot."""
        self._robots = {**self._robots, name: watched}

    def remove(self, name: str) -> None:
        """Stop watching a robot."""
        self._robots = {other: watched for other, watched in self._robots.items() if other != name}

    def _run(self) -> None:
        """Look at everything until the end."""
        while not self._ended.wait(PERIOD):
            self.look(self._clock.monotonic())

    def look(self, now: float) -> None:
        """Look once, at the monotonic time ``now``."""
        for watched in self._robots.values():
            if watched.deadman.expire(now):
                watched.halt()
                watched.expired()
        self._look_at_loop(now)

    def _look_at_loop(self, now: float) -> None:
        """Name who blocks the loop, once; give the process up when it never comes back."""
        silent = now - self._loop.beat()
        if silent < BLOCKED:
            self._named = ""
            return
        if not self._named:
            self._named = self._loop.running() or "the host"
            self._loop.blocked(self._named, silent)
        if silent > STUCK:
            for watched in self._robots.values():
                watched.halt()
            self._loop.stuck(self._named)
