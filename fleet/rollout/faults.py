"""What is wrong on an edge, part by part, and whether it got worse. Pure.

The health of an edge as a whole is that of its worst part: it does not change when one fault takes the place
of another.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from enum import StrEnum

import msgspec

from fleet.health.aggregate import LEVELS
from fleet.model.health import Level
from fleet.model.state import EdgeState, RobotState

EDGE, CLOUD = "the edge", "the cloud"  # parts that are no robot: no robot's name has a blank
LONGEST_CAUSE = 200  # characters
_CLOUD_LEVELS = {"connected": Level.DEGRADED, "refused": Level.FAULT}  # else it is not reached
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


class Fault(msgspec.Struct, frozen=True):
    """What is wrong with one part of an edge: a robot, the cloud, the edge itself.

    ``level`` is a word of ``Level``.
    """

    part: str
    level: str
    cause: str


class Worse(StrEnum):
    """Whether a part with one level before and another now is worse."""

    NO = "no"
    NEW_CAUSE = "new cause"  # if the cause is another
    YES = "yes"


WORSE: Mapping[Level, Mapping[Level, Worse]] = {
    Level.OK: {
        Level.OK: Worse.NO,
        Level.DEGRADED: Worse.YES,
        Level.OFFLINE: Worse.YES,
        Level.FAULT: Worse.YES,
    },
    Level.DEGRADED: {
        Level.OK: Worse.NO,
        Level.DEGRADED: Worse.NEW_CAUSE,
        Level.OFFLINE: Worse.YES,
        Level.FAULT: Worse.YES,
    },
    Level.OFFLINE: {
        Level.OK: Worse.NO,
        Level.DEGRADED: Worse.NO,
        Level.OFFLINE: Worse.NO,
        Level.FAULT: Worse.YES,
    },
    Level.FAULT: dict.fromkeys(Level, Worse.NO),
}
"""By the level before and the level now.

A new cause counts only where the part works: of one that cannot be reached or used nobody knows what else is
wrong with it, and a restart alone gives its silence other words.
"""


def faults_of(edge: EdgeState, robots: Iterable[RobotState]) -> tuple[Fault, ...]:
    """Return what is wrong with an edge and its robots; those of other edges do not count."""
    services = list(_of_services(edge))
    own = [_fault(robot.name, robot.health, robot.cause) for robot in robots if robot.edge == edge.edge]
    told = [*map(_level, services), *(min(_level(fault), Level.DEGRADED) for fault in own)]
    whole = _fault(EDGE, edge.health, edge.cause)  # an older edge does not tell its own problems
    unexplained = [whole] if _level(whole) > max(told, default=Level.OK) else []
    return tuple(fault for fault in (*services, *own, *unexplained) if _level(fault) is not Level.OK)


def got_worse(before: Iterable[Fault], now: Iterable[Fault]) -> tuple[str, ...]:
    """Return in words what is wrong now and was not, or not as much, before; empty when nothing is."""
    known = {_place(fault): fault for fault in before}
    pairs = ((known.get(_place(fault)), fault) for fault in now)
    return tuple(_words(was, fault) for was, fault in pairs if _is_worse(was, fault))


def _of_services(edge: EdgeState) -> Iterator[Fault]:
    """Yield what is wrong with what the edge itself rests on."""
    if edge.cloud_cause:
        yield _fault(CLOUD, _CLOUD_LEVELS.get(edge.cloud, Level.OFFLINE).word, edge.cloud_cause)
    for problem in edge.problems:
        yield _fault(EDGE, Level.DEGRADED.word, problem)


def _fault(part: str, level: str, cause: str) -> Fault:
    """Return a fault; its cause is cut to length."""
    return Fault(part, level, cause[:LONGEST_CAUSE])


def _level(fault: Fault) -> Level:
    """Return how bad a fault is; an unknown word counts as the worst."""
    return LEVELS.get(fault.level, Level.FAULT)


def _place(fault: Fault) -> tuple[str, str]:
    """Return where a fault is: each problem of the edge itself is a place of its own."""
    return fault.part, _without_figures(fault.cause) if fault.part == EDGE else ""


def _without_figures(cause: str) -> str:
    """Return a cause without its numbers, which change while it stays the same."""
    return _NUMBER.sub("#", cause)


def _is_worse(was: Fault | None, fault: Fault) -> bool:
    """Return whether a part is worse than it was; None: nothing was wrong with it."""
    verdict = WORSE[_level(was) if was else Level.OK][_level(fault)]
    if verdict is Worse.NEW_CAUSE and was is not None:
        return _without_figures(was.cause) != _without_figures(fault.cause)
    return verdict is Worse.YES


def _words(was: Fault | None, fault: Fault) -> str:
    """Return in words how a part got worse."""
    before = "ok" if was is None else was.level
    if before == fault.level:
        return f"{fault.part} is {fault.level} for another cause than before: {fault.cause}"
    return f"{fault.part} is {fault.level}, was {before}: {fault.cause}"
