"""The edges that hold the twins of a process, by bus and cloud: only a robot whose twin is ours is run."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping

import msgspec

from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.host.process.adapter_runs import AdapterRuns
from fleet.host.process.twin_claims import TwinClaims
from fleet.host.robot.local_robot import LocalRobot
from fleet.runtime.decoding import decode_json

log = logging.getLogger(__name__)


class TwinHolders:
    """The holders of the twins of one process; starts and ends the runs of its ``robots`` accordingly.

    ``claims`` decides on the bus; the edge reports the holders seen in the cloud. ``settle``: seconds in
    which other edges can show the twins that they hold, before a robot is run. ``changed`` hears twin and
    holder, empty when no other edge holds it.
    """

    def __init__(
        self,
        edge: str,
        bus_session: ZenohSession,
        robots: Mapping[str, LocalRobot],
        runs: AdapterRuns,
        *,
        settle: float,
        clock: Clock,
    ) -> None:
        self._robots = robots
        self._runs = runs
        self._loop = asyncio.get_running_loop()
        self._holders: dict[str, dict[str, str]] = {}  # by twin: the edge by source, bus or cloud
        self.changed: Callable[[str, str], None] = lambda _twin, _holder: None
        self.moves_elsewhere: Callable[[str], bool] = lambda _twin: False  # of robots in workers
        self.claims = TwinClaims(
            edge,
            [robot.twin for robot in robots.values()],
            bus_session,
            settle=settle,
            changed=self.set_bus_holder,
            moves=self._moves,
            clock=clock,
        )

    def set_bus_holder(self, twin: str, holder: str) -> None:
        """Set the holder of a twin by the tokens on the bus."""
        self._hold(twin, "bus", holder)

    def set_cloud_holder(self, twin: str, holder: str) -> None:
        """Set the holder of a twin by the heartbeats in the cloud."""
        self._hold(twin, "cloud", holder)

    def read(self, payload: bytes) -> None:
        """Read the edge's message with the holders seen in the cloud; in a worker, on the bus's thread."""
        try:
            holders = decode_json(payload, dict[str, str])
        except msgspec.DecodeError as error:
            log.warning("the holders of our twins cannot be read: %s", error)
            return
        self._loop.call_soon_threadsafe(self._apply, holders)

    def give_up(self, twin: str) -> None:
        """Stop claiming a twin that no robot has any more."""
        self.claims.give_up(twin)
        self._holders.pop(twin, None)

    def update(self, robot: LocalRobot) -> None:
        """Run a robot or end its run, depending on the known holder of its twin."""
        for where, holder in list(self._holders.get(robot.twin, {}).items())[:1]:
            self._hold(robot.twin, where, holder)

    def _apply(self, holders: Mapping[str, str]) -> None:
        """Apply changed holders; an unproven claim does not take a robot that was moved meanwhile."""
        for robot in self._robots.values():
            holder = holders.get(robot.twin, "")
            known = self._holders.get(robot.twin, {}).get("cloud", "")
            if holder != known and not (holder and robot.in_use):
                self.set_cloud_holder(robot.twin, holder)

    def _hold(self, twin: str, where: str, holder: str) -> None:
        """Run the robot of a twin unless another edge holds it; end its run then."""
        holders = self._holders.setdefault(twin, {})
        holders[where] = holder
        first = next(filter(None, holders.values()), "")
        self.changed(twin, first)
        for robot in self._robots.values():
            if robot.twin == twin and not first:
                self._runs.run(robot)
            elif robot.twin == twin:
                self._runs.suspend(robot, f"edge {first} has its twin; one of the two must leave it out")

    def _moves(self, twin: str) -> bool:
        """Return True while the robot of a twin is moved by this edge."""
        here = any(robot.controller.in_motion for robot in self._robots.values() if robot.twin == twin)
        return here or self.moves_elsewhere(twin)
