"""Emergency stops in a pair, for one of its edges: set, listed in the lease, and followed."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from functools import partial

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.runtime.threads import run_in_thread
from fleet.runtime.exception_barrier import log_exceptions
from fleet.standby.lease import LeaseEntry
from fleet.standby.stops import FollowedStops, OwnStop

log = logging.getLogger(__name__)

LONGEST_CAUSE = 80  # characters
NOT_KNOWN = "the stops set before are unknown: the lease service has no entry of the pair"


class PairStops:
    """Stops of one edge's robots; ``other`` is the other edge. On the event loop, except ``listed``."""

    def __init__(
        self, other: str, robots: Mapping[str, LocalRobot], bus_session: ZenohSession, clock: Clock
    ) -> None:
        self._other = other
        self._robots = robots
        self._bus_session = bus_session
        self._clock = clock
        self._followed = FollowedStops()

    @property
    def listed(self) -> dict[str, str]:
        """Robots whose emergency stop is set, with its cause; from any thread.

        Causes are shortened: those of a thousand robots must fit into the lease.
        """
        stopped = {name: each.controller.latch for name, each in list(self._robots.items()) if _is_set(each)}
        return {name: latch.cause[:LONGEST_CAUSE] for name, latch in stopped.items()}

    def take_over(self, entry: LeaseEntry | None) -> None:
        """Set the stops that were set when the lease was taken; all, if unknown. No robot runs yet."""
        if entry is None:
            self._engage(dict.fromkeys(self._robots, NOT_KNOWN))
        elif entry.edge == self._other:
            self._engage({name: self._cause(why) for name, why in entry.stops.items()})

    def follow(self, entry: LeaseEntry) -> None:
        """Set and release stops as the holder has them; forward those that only this edge received."""
        own = {
            name: OwnStop(each.controller.latched, each.controller.latch.requested)
            for name, each in self._robots.items()
        }
        what = self._followed.follow(entry.stops, own, self._clock.monotonic())
        self._engage({name: self._cause(why) for name, why in what.stop.items()})
        for name in what.release:
            log.warning("%s: its emergency stop was released at edge %s", name, entry.edge)
            latch = self._robots[name].controller.latch
            latch.release()
            if latch.requested != own[name].requested:  # a stop arrived meanwhile, on the bus's thread
                latch.engage("a stop that came with the release")
                latch.record()
        if what.forward:
            self._forward(entry.edge, what.forward)

    def _forward(self, holder: str, robots: Sequence[str]) -> None:
        """Send a stop to the holder; the link to it may be full or gone, and the loop serves other robots."""
        put = log_exceptions(log, f"a stop could not be passed on to edge {holder}; it is tried again")
        payload = msgspec.json.encode(robots)
        run_in_thread(partial(put(self._bus_session.put), keys.stop(holder), payload, urgent=True))

    def _cause(self, why: str) -> str:
        """Return the cause of a stop that was set at the other edge."""
        return f"set at edge {self._other}: {why}"

    def _engage(self, stops: Mapping[str, str]) -> None:
        """Set emergency stops of robots that do not run here."""
        for name, why in stops.items():
            robot = self._robots.get(name)
            if robot is not None and not _is_set(robot):
                log.warning("%s: its emergency stop is set here too: %s", name, why)
                robot.controller.latch.engage(why)
                robot.controller.latch.record()


def _is_set(robot: LocalRobot) -> bool:
    """Return whether a robot's emergency stop is set."""
    return robot.controller.latched
