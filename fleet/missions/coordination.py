"""The lease by which an edge coordinates robots of another edge in a run; pure.

The edge that carries out the run asks for the lease before a robot joins, and renews it while the run has the
robot. Each renewal says what the robot is to do if it is the last one (``robot_failed.do`` of the step). When
the lease lapses, the robot's own edge does that by itself, and takes the robot out of the run: a command of
the run that arrives later is refused.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

RENEWED_EVERY = 1.0  # s
LAPSES_AFTER = 3.0  # s without a renewal


class LeaseAsk(msgspec.Struct, frozen=True, omit_defaults=True):
    """Ask for the lease of robots, or renew it. ``robots``: what each does when it lapses, by name.

    Robots that are left out are given back. ``way``, ``source_type`` and ``session_id`` are the authority of
    the run, which is checked when ``begins``.
    """

    run: str
    edge: str
    robots: Mapping[str, str]
    begins: bool = False
    way: str = "bus"
    source_type: str | None = None
    session_id: str = ""


class LeaseAnswer(msgspec.Struct, frozen=True, omit_defaults=True):
    """The answer: why it is refused, empty when it is granted. ``site`` is the origin of the edge's frame."""

    refusal: str = ""
    site: tuple[float, float, float] | None = None


class Lapsed(msgspec.Struct, frozen=True):
    """A robot whose lease has lapsed, and what it is to do."""

    run: str
    edge: str
    robot: str
    do: str


class CoordinatorLeases:
    """The leases that other edges hold of robots of this edge. Times are monotonic seconds."""

    def __init__(self) -> None:
        self._held: dict[tuple[str, str], tuple[float, Mapping[str, str]]] = {}

    def grant(self, ask: LeaseAsk, now: float) -> None:
        """Grant or renew a lease; one without robots has ended."""
        key = ask.edge, ask.run
        self._held.pop(key, None)
        if ask.robots:
            self._held[key] = now + LAPSES_AFTER, ask.robots

    def holds(self, edge: str, run: str) -> bool:
        """Return whether an edge holds the lease of a run."""
        return (edge, run) in self._held

    def lapsed(self, now: float) -> list[Lapsed]:
        """Return, once, the robots whose leases have lapsed."""
        over = [key for key, (until, _) in self._held.items() if now >= until]
        return [
            Lapsed(run, edge, robot, do)
            for edge, run in over
            for robot, do in self._held.pop((edge, run))[1].items()
        ]
