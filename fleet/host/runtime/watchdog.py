"""Watchdog thread: ends velocities with an expired lease, and names the robot that blocks the event loop.

It shares only the leases with the loop, so it works while the loop is blocked. It never waits long: halts and
log messages run on other threads, because the loop may be blocked in a robot's halt or in the log.
"""

from __future__ import annotations

import logging
import math
import operator
import threading
from collections.abc import Callable

import msgspec

from fleet.clock import Clock
from fleet.host.runtime.loop_monitor import LoopSilence
from fleet.host.runtime.threads import HALT_WAIT, call_sequentially, run_in_thread
from fleet.host.safety.deadman import DeadMan
from fleet.runtime.realtime import prefer_watcher

log = logging.getLogger(__name__)

PERIOD = 0.02  # s between checks, at most; an earlier lease end is waited for exactly
SHORTEST = 0.001  # s between checks, at least
BLOCKED = 0.25  # s without a tick after which the loop counts as blocked
STUCK = 10.0  # s after which the process is ended
ASLEEP = 0.25  # s without a check after which the whole process counts as having been stopped
BACKLOG = 1.0  # s after such a stop in which data being read may have arrived during it


class WatchedRobot(msgspec.Struct, frozen=True):
    """One robot under watch. Both functions run on another thread; ``expired`` must hand over to the loop."""

    deadman: DeadMan
    halt: Callable[[], None]
    expired: Callable[[], None]


class LoopWatch(msgspec.Struct, frozen=True):
    """The watchdog's view of the event loop, and its reactions.

    ``beat``: time of the last tick (monotonic s); ``cpu``: processor seconds of its thread; ``waited``:
    seconds for which it was runnable without a processor, which is no robot's fault; ``running``: owner of
    the code being run. ``blocked`` gets the owner and the seconds, once per block; ``stuck`` is the last
    resort.
    """

    beat: Callable[[], float]
    cpu: Callable[[], float]
    waited: Callable[[], float]
    running: Callable[[], str]
    blocked: Callable[[str, float], None]
    stuck: Callable[[str], None]


_END = operator.attrgetter("until")


class Watchdog:
    """The watchdog thread; robots are added while it runs."""

    def __init__(self, clock: Clock, loop: LoopWatch) -> None:
        self._clock = clock
        self._loop = loop
        self._robots: dict[str, WatchedRobot] = {}
        self._running: set[DeadMan] = set()  # those with a running lease
        self._ended = threading.Event()
        self._silence = LoopSilence(PERIOD)
        self._named = ""
        self._looked = math.inf
        self._asleep = (0.0, -math.inf)  # begin and end of the last stop of the process
        self._thread = threading.Thread(target=self._run, name="fleet-watchdog", daemon=True)

    def start(self) -> None:
        """Start watching."""
        self._thread.start()

    def stop(self) -> None:
        """Stop; returns when the thread has ended, or after 1 s."""
        self._ended.set()
        self._looked = math.inf
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)

    def arrival(self) -> float:
        """Return since when (monotonic s) a message read now may have been waiting; from any thread.

        Usually now; earlier if the process was stopped or had no processor, so that it could not read.
        """
        now, looked = self._clock.monotonic(), self._looked
        if now - looked > ASLEEP:
            return looked
        since, until = self._asleep
        return since if now - until < BACKLOG else now

    def add(self, name: str, watched: WatchedRobot) -> None:
        """Watch a robot, instead of an earlier one of the same name."""
        if name in self._robots:
            self._robots[name].deadman.join(set())
        self._robots = {**self._robots, name: watched}
        watched.deadman.join(self._running)

    def remove(self, name: str) -> None:
        """Stop watching a robot; no effect for an unknown name."""
        watched = self._robots.get(name)
        if watched is not None:
            self._robots = {other: each for other, each in self._robots.items() if other != name}
            watched.deadman.join(set())

    def _run(self) -> None:
        """Check until the end."""
        prefer_watcher()
        patience = PERIOD
        while not self._ended.wait(patience):
            patience = PERIOD
            try:
                patience = self.check(self._clock.monotonic())
            except Exception as error:  # noqa: BLE001 - without this thread no lease would expire
                _log_failure(error)

    def _first_end(self) -> float:
        """Return when the first lease ends (monotonic s)."""
        return min(map(_END, self._running.copy()), default=math.inf)

    def check(self, now: float) -> float:
        """Check once, at the monotonic time ``now``; never raises.

        Returns how long to sleep from ``now``: until the first lease ends, at most ``PERIOD``.
        """
        if now - self._looked > ASLEEP:
            self._asleep = (self._looked, now)
        self._looked = now
        first = self._first_end()
        if first <= now:
            over = [watched for watched in self._robots.values() if watched.deadman.expire(now)]
            call_sequentially(map(_expiry, over), wait=HALT_WAIT)
        _safely(lambda: self._look_at_loop(now))
        return max(SHORTEST, min(first - now, PERIOD))

    def _look_at_loop(self, now: float) -> None:
        """Name the owner of a blocked loop, once; end the process if the loop stays blocked.

        Time in which the computer gave the loop no processor counts against no robot.
        """
        silent = self._silence.update(now, self._loop.beat(), self._loop.cpu(), self._loop.waited)
        if silent < BLOCKED:
            self._named = ""
            return
        if not self._named and self._silence.attributable >= BLOCKED:
            name = self._named = self._loop.running() or "the host"
            run_in_thread(lambda: _safely(lambda: self._loop.blocked(name, silent)))
        if silent > STUCK:
            call_sequentially(map(_halting, self._robots.values()), wait=HALT_WAIT)
            self._loop.stuck(self._named or "a process that has no processor")


def _halting(watched: WatchedRobot) -> Callable[[], None]:
    """Return a call that halts a robot."""
    return lambda: _safely(watched.halt)


def _expiry(watched: WatchedRobot) -> Callable[[], None]:
    """Return the call for an expired lease: halt, then notify the loop."""

    def expire() -> None:
        _safely(watched.halt)
        _safely(watched.expired)

    return expire


def _safely(call: Callable[[], None]) -> None:
    """Make a call whose failure must not keep the watchdog from the next."""
    try:
        call()
    except Exception as error:  # noqa: BLE001 - logged on another thread; the watchdog goes on
        _log_failure(error)


def _log_failure(failure: Exception) -> None:
    """Log a failure on another thread."""
    run_in_thread(lambda: log.error("the watchdog goes on", exc_info=failure))
