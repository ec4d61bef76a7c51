"""Lease by which an edge coordinates robots of another edge in a run; pure.

The edge that executes the run requests the lease before a robot joins, and renews it while the run has the
robot. Each renewal contains the action for its expiry (``robot_failed.do`` of the step). When the lease
expires, the robot's own edge executes that action and removes the robot from the run: a later command of the
run is refused.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

RENEWED_EVERY = 1.0  # s
LAPSES_AFTER = 3.0  # s without a renewal


class RobotLeaseRequest(msgspec.Struct, frozen=True, omit_defaults=True):
    """Request or renewal of the lease of robots; ``robots``: the action of each after the expiry, by name.

    Robots that are left out of a renewal are released; it cannot add any. ``transport``, ``source_type`` and
    ``session_id`` are the authority of the run, which is checked if ``begins``.
    """

    run: str
    edge: str
    robots: Mapping[str, str]
    begins: bool = False
    transport: str = msgspec.field(name="way", default="bus")
    source_type: str | None = None
    session_id: str = ""


class LeaseAnswer(msgspec.Struct, frozen=True, omit_defaults=True):
    """The reply: the reason of a refusal, empty if granted. ``site`` is the origin of the edge's frame."""

    refusal: str = ""
    site: tuple[float, float, float] | None = None


class ExpiredLease(msgspec.Struct, frozen=True):
    """A robot whose lease has expired, with the action to execute."""

    run: str
    edge: str
    robot: str
    do: str


class CoordinatorLeases:
    """Leases that other edges hold of robots of this edge. Times are monotonic seconds."""

    def __init__(self) -> None:
        self._held: dict[tuple[str, str], tuple[float, Mapping[str, str]]] = {}

    def grant(self, request: RobotLeaseRequest, now: float) -> None:
        """Grant or renew a lease; without robots it ends."""
        key = request.edge, request.run
        self._held.pop(key, None)
        if request.robots:
            self._held[key] = now + LAPSES_AFTER, request.robots

    def robots(self, edge: str, run: str) -> frozenset[str]:
        """Return the robots that an edge has in a run; none without a lease."""
        return frozenset(self._held[edge, run][1]) if (edge, run) in self._held else frozenset()

    def lapsed(self, now: float) -> list[ExpiredLease]:
        """Remove expired leases; return their robots."""
        over = [key for key, (until, _) in self._held.items() if now >= until]
        return [
            ExpiredLease(run, edge, robot, do)
            for edge, run in over
            for robot, do in self._held.pop((edge, run))[1].items()
        ]
