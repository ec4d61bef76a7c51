"""What heartbeats in the cloud say of who has our twins: a claim that nothing proves.

Who may publish at a twin can invent an edge that serves it. So such a claim takes no robot from who moves it:
it keeps one out that nobody has moved through this edge yet. Of any other it is told, and not believed.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Protocol

import msgspec

log = logging.getLogger(__name__)


class Claimed(Protocol):
    """A robot whose twin may be claimed, here or in a worker."""

    name: str

    @property
    def in_use(self) -> bool:
        """True once somebody has moved it through this edge, until the edge lets go of it."""


class CloudClaims:
    """The claims on one edge's twins, by the cloud. On the loop only.

    ``hold`` hears twin and holder of each claim that counts, empty when it has ended; ``tell`` publishes to
    the workers, which are not connected to the cloud, who has which twin.
    """

    def __init__(
        self,
        robots: dict[str, Claimed],
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
        """What is claimed and not believed, in words; empty when nothing is."""
        said = (f"edge {edge} says in the cloud that it has {robot}" for robot, edge in self._doubted.items())
        return "; ".join(said) + " (not believed: it is in use here)" if self._doubted else ""

    def join(self, twin: str, robot: Claimed) -> None:
        """Take claims on one more twin, or on the twin of another robot now."""
        if before := self._robots.get(twin):
            self._doubted.pop(before.name, None)
        self._robots[twin] = robot

    def leave(self, twin: str) -> None:
        """Take no more claims on a twin."""
        if robot := self._robots.pop(twin, None):
            self._doubted.pop(robot.name, None)
        self._holders.pop(twin, None)

    def heard(self, twin: str, holder: str) -> None:
        """Take a claim, or with an empty ``holder`` its end."""
        robot = self._robots.get(twin)
        if robot is None:  # the edge has just let go of it
            return
        self._doubted.pop(robot.name, None)
        if holder and robot.in_use:
            self._doubted[robot.name] = holder
            line = "%s: edge %s says in the cloud that it has its twin; not believed: it is in use here"
            log.warning(line, robot.name, holder)
            return
        self._holders[twin] = holder
        self._hold(twin, holder)
        self.tell_workers()

    def tell_workers(self) -> None:
        """Tell the workers again: one may have been started anew."""
        self._tell(msgspec.json.encode(self._holders))
