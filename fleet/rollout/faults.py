"""Faults of the parts of an edge, and whether they got worse. Pure.

The health of a whole edge is that of its worst part. It does not change if one fault replaces another;
therefore the parts are compared.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from enum import StrEnum

import msgspec

from fleet.health.aggregate import LEVELS
from fleet.model.health import Level
from fleet.model.state import EdgeState, RobotState

EDGE, CLOUD = "the edge", "the cloud"  # parts that are no robot; names of robots have no blanks
LONGEST_CAUSE = 200  # characters
_CLOUD_LEVELS = {"connected": Level.DEGRADED, "refused": Level.FAULT}  # any other state: OFFLINE
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


class PartFault(msgspec.Struct, frozen=True):
    """Fault of one part of an edge: a robot, the cloud, or the edge itself.

    ``level`` is a word of ``Level``.
    """

    part: str
    level: str
    cause: str


class Degradation(StrEnum):
    """Whether a part got worse between two levels."""

    NO = "no"
    NEW_CAUSE = "new cause"  # only if its cause has changed
    YES = "yes"


WORSE: Mapping[Level, Mapping[Level, Degradation]] = {
    Level.OK: {
        Level.OK: Degradation.NO,
        Level.DEGRADED: Degradation.YES,
        Level.OFFLINE: Degradation.YES,
        Level.FAULT: Degradation.YES,
    },
    Level.DEGRADED: {
        Level.OK: Degradation.NO,
        Level.DEGRADED: Degradation.NEW_CAUSE,
        Level.OFFLINE: Degradation.YES,
        Level.FAULT: Degradation.YES,
    },
    Level.OFFLINE: {
        Level.OK: Degradation.NO,
        Level.DEGRADED: Degradation.NO,
        Level.OFFLINE: Degradation.NO,
        Level.FAULT: Degradation.YES,
    },
    Level.FAULT: dict.fromkeys(Level, Degradation.NO),
}
"""Comparison by the previous and the present level.

A new cause counts only for a part that works. Other faults of a part that is unreachable or unusable are
unknown, and a mere restart changes the wording of its cause.
"""


def faults_of(edge: EdgeState, robots: Iterable[RobotState]) -> tuple[PartFault, ...]:
    """Return the faults of an edge and of its robots; robots of other edges are ignored."""
    services = list(_of_services(edge))
    own = [_fault(robot.name, robot.health, robot.cause) for robot in robots if robot.edge == edge.edge]
    levels = [*map(_level, services), *(min(_level(fault), Level.DEGRADED) for fault in own)]
    whole = _fault(EDGE, edge.health, edge.cause)  # an older edge does not report its own problems
    unexplained = [whole] if _level(whole) > max(levels, default=Level.OK) else []
    return tuple(fault for fault in (*services, *own, *unexplained) if _level(fault) is not Level.OK)


def got_worse(before: Iterable[PartFault], now: Iterable[PartFault]) -> tuple[str, ...]:
    """Return a text for each part that is worse than before; empty if none is."""
    known = {_place(fault): fault for fault in before}
    pairs = ((known.get(_place(fault)), fault) for fault in now)
    return tuple(_words(was, fault) for was, fault in pairs if _is_worse(was, fault))


def _of_services(edge: EdgeState) -> Iterator[PartFault]:
    """Yield the faults of the cloud connection and of the edge itself."""
    if edge.cloud_cause:
        yield _fault(CLOUD, _CLOUD_LEVELS.get(edge.cloud, Level.OFFLINE).word, edge.cloud_cause)
    for problem in edge.problems:
        yield _fault(EDGE, Level.DEGRADED.word, problem)


def _fault(part: str, level: str, cause: str) -> PartFault:
    """Return a fault with its cause cut to ``LONGEST_CAUSE``."""
    return PartFault(part, level, cause[:LONGEST_CAUSE])


def _level(fault: PartFault) -> Level:
    """Return the level of a fault; an unknown word counts as the worst."""
    return LEVELS.get(fault.level, Level.FAULT)


def _place(fault: PartFault) -> tuple[str, str]:
    """Return the key by which a fault is compared: its part, and for the edge itself also its cause."""
    return fault.part, _without_figures(fault.cause) if fault.part == EDGE else ""


def _without_figures(cause: str) -> str:
    """Return a cause without its numbers, which may change while the cause stays the same."""
    return _NUMBER.sub("#", cause)


def _is_worse(was: PartFault | None, fault: PartFault) -> bool:
    """Return whether a part is worse than before; ``was`` is None if it had no fault."""
    verdict = WORSE[_level(was) if was else Level.OK][_level(fault)]
    if verdict is Degradation.NEW_CAUSE and was is not None:
        return _without_figures(was.cause) != _without_figures(fault.cause)
    return verdict is Degradation.YES


def _words(was: PartFault | None, fault: PartFault) -> str:
    """Return a text about a part that got worse."""
    before = "ok" if was is None else was.level
    if before == fault.level:
        return f"{fault.part} is {fault.level} for another cause than before: {fault.cause}"
    return f"{fault.part} is {fault.level}, was {before}: {fault.cause}"
