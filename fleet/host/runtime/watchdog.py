"""The watchdog thread: ends velocities whose lease ran out, and names whoever blocks the event loop.

It shares nothing with the loop but the leases, so it works while the loop is stuck. It waits for nothing
for long: halts, and what there is to tell, are made on threads beside it, because a robot's halt or the log
may be what the loop is stuck in.
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
from fleet.host.runtime.threads import HALT_WAIT, run_in_thread, run_in_turn
from fleet.host.safety.deadman import DeadMan

log = logging.getLogger(__name__)

PERIOD = 0.02  # s between looks, at most: a lease that runs out before is awaited to its end
SHORTEST = 0.001  # s between looks, at least
BLOCKED = 0.25  # s without a turn of the wheel after which the loop counts as blocked
STUCK = 10.0  # s after which the process is given up
ASLEEP = 0.25  # s without a look after which the whole process counts as having been stopped
BACKLOG = 1.0  # s after such a sleep in which what is read may have come during it


class Watched(msgspec.Struct, frozen=True):
    """One robot under watch; both are called on a thread beside, ``expired`` must hand over to the loop."""

    deadman: DeadMan
    halt: Callable[[], None]
    expired: Callable[[], None]


class LoopWatch(msgspec.Struct, frozen=True):
    """How the watchdog sees the loop, and what it does about it.

    ``beat``: its last turn (monotonic s); ``cpu``: the processor seconds that its thread has used;
    ``waited``: those for which it was ready to run and got no processor, which is nobody's fault in here;
    ``running``: on whose behalf it runs. ``blocked`` gets the name and the seconds, once per block;
    ``stuck`` is the last resort.
    """

    beat: Callable[[], float]
    cpu: Callable[[], float]
    waited: Callable[[], float]
    running: Callable[[], str]
    blocked: Callable[[str, float], None]
    stuck: Callable[[str], None]


_END = operator.attrgetter("until")


class Watchdog:
    """The thread; robots are added while it runs."""

    def __init__(self, clock: Clock, loop: LoopWatch) -> None:
        self._clock = clock
        self._loop = loop
        self._robots: dict[str, Watched] = {}
        self._running: set[DeadMan] = set()  # those of the robots that hold a lease
        self._ended = threading.Event()
        self._silence = LoopSilence(PERIOD)
        self._named = ""
        self._looked = math.inf
        self._asleep = (0.0, -math.inf)  # from when to when the process last was
        self._thread = threading.Thread(target=self._run, name="fleet-watchdog", daemon=True)

    def start(self) -> None:
        """Begin to watch."""
        self._thread.start()

    def stop(self) -> None:
        """End; returns when the thread has ended."""
        self._ended.set()
        self._looked = math.inf
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)

    def arrival(self) -> float:
        """Return since when (monotonic s) what is read now may have waited to be read; from any thread.

        That is now, but for a process that was stopped, or had no processor: nobody in it could read.
        """
        now, looked = self._clock.monotonic(), self._looked
        if now - looked > ASLEEP:
            return looked
        since, until = self._asleep
        return since if now - until < BACKLOG else now

    def add(self, name: str, watched: Watched) -> None:
        """Watch a robot, in place of one of its name."""
        if name in self._robots:
            self._robots[name].deadman.join(set())
        self._robots = {**self._robots, name: watched}
        watched.deadman.join(self._running)

    def remove(self, name: str) -> None:
        """Watch a robot no more; harmless for one that is not watched."""
        watched = self._robots.get(name)
        if watched is not None:
            self._robots = {other: each for other, each in self._robots.items() if other != name}
            watched.deadman.join(set())

    def _run(self) -> None:
        """Look at everything until the end."""
        patience = PERIOD
        while not self._ended.wait(patience):
            patience = PERIOD
            try:
                patience = self.look(self._clock.monotonic())
            except Exception as error:  # noqa: BLE001 - without this thread no lease would end
                _tell_aside(error)

    def _first_end(self) -> float:
        """Return when the first lease ends (monotonic s)."""
        return min(map(_END, self._running.copy()), default=math.inf)

    def look(self, now: float) -> float:
        """Look once, at the monotonic time ``now``; never raises.

        Returns how long to sleep from ``now``: to the end of the first lease, at most ``PERIOD``.
        """
        if now - self._looked > ASLEEP:
            self._asleep = (self._looked, now)
        self._looked = now
        first = self._first_end()
        if first <= now:
            over = [watched for watched in self._robots.values() if watched.deadman.expire(now)]
            run_in_turn(map(_expiry, over), wait=HALT_WAIT)
        _safely(lambda: self._look_at_loop(now))
        return max(SHORTEST, min(first - now, PERIOD))

    def _look_at_loop(self, now: float) -> None:
        """Name who blocks the loop, once; give the process up when it never comes back.

        Nobody is named for the time in which the computer gave the loop no processor.
        """
        silent = self._silence.look(now, self._loop.beat(), self._loop.cpu(), self._loop.waited())
        if silent < BLOCKED:
            self._named = ""
            return
        if not self._named and self._silence.blamed >= BLOCKED:
            name = self._named = self._loop.running() or "the host"
            run_in_thread(lambda: _safely(lambda: self._loop.blocked(name, silent)))
        if silent > STUCK:
            run_in_turn(map(_halting, self._robots.values()), wait=HALT_WAIT)
            self._loop.stuck(self._named or "a process that has no processor")


def _halting(watched: Watched) -> Callable[[], None]:
    """Return what halts a robot."""
    return lambda: _safely(watched.halt)


def _expiry(watched: Watched) -> Callable[[], None]:
    """Return what is done when a robot's lease has run out."""

    def expire() -> None:
        _safely(watched.halt)
        _safely(watched.expired)

    return expire


def _safely(call: Callable[[], None]) -> None:
    """Make a call of which nothing must keep the watchdog from the next."""
    try:
        call()
    except Exception as error:  # noqa: BLE001 - told aside; the watchdog goes on
        _tell_aside(error)


def _tell_aside(failure: Exception) -> None:
    """Tell of a failure, on a thread beside."""
    run_in_thread(lambda: log.error("the watchdog goes on", exc_info=failure))
