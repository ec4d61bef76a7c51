"""Claims on our twins by heartbeats in the cloud, which prove nothing.

Anyone who may publish for a twin can invent an edge that serves it. So such a claim takes no robot from its
user: it only keeps out a robot that was not moved through this edge yet. Any other is reported and
ignored.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Protocol

import msgspec

log = logging.getLogger(__name__)


class ClaimableRobot(Protocol):
    """A robot whose twin may be claimed, here or in a worker."""

    name: str

    @property
    def in_use(self) -> bool:
        """True once it was moved through this edge, until the edge gives it up."""


class CloudClaims:
    """Claims on one edge's twins, from the cloud. On the event loop only.

    ``hold`` gets twin and holder of each claim that counts, empty at its end; ``tell`` publishes the holders
    to the workers, which have no connection to the cloud.
    """

    def __init__(
        self,
        robots: dict[str, ClaimableRobot],
        *,
        hold: Callable[[str, str], None],
        tell: Callable[[bytes], None],
    ) -> None:
        self._robots = robots
        self._hold = hold
        self._tell = tell
        self._holders: dict[str, str] = {}
        self._doubted: dict[str, str] = {}

    @property
    def problem(self) -> str:
        """Claims that are ignored, as text; empty for none."""
        said = (f"edge {edge} says in the cloud that it has {robot}" for robot, edge in self._doubted.items())
        return "; ".join(said) + " (not believed: it is in use here)" if self._doubted else ""

    def join(self, twin: str, robot: ClaimableRobot) -> None:
        """Accept claims on one more twin, or on a twin that another robot has now."""
        if before := self._robots.get(twin):
            self._doubted.pop(before.name, None)
        self._robots[twin] = robot

    def leave(self, twin: str) -> None:
        """Ignore claims on a twin from now on."""
        if robot := self._robots.pop(twin, None):
            self._doubted.pop(robot.name, None)
        self._holders.pop(twin, None)

    def handle_claim(self, twin: str, holder: str) -> None:
        """Process a claim, or with an empty ``holder`` its end."""
        robot = self._robots.get(twin)
        if robot is None:  # the edge has just given it up
            return
        self._doubted.pop(robot.name, None)
        if holder and robot.in_use:
            self._doubted[robot.name] = holder
            line = "%s: edge %s says in the cloud that it has its twin; not believed: it is in use here"
            log.warning(line, robot.name, holder)
            return
        self._holders[twin] = holder
        self._hold(twin, holder)
        self.notify_workers()

    def notify_workers(self) -> None:
        """Publish the holders to the workers; repeatedly, since one may have been restarted."""
        self._tell(msgspec.json.encode(self._holders))
