"""State machine of the waves of a roll-out: which edges get their bundle next, and when it stops. Pure.

Bundles are assigned to the edges in their order. A wave begins when all edges of the previous wave have
settled, provided that the limit on failures has held at each step. Failures are counted as a share of the
edges assigned so far, so that a bundle that no edge can use stops the roll-out in its first wave.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from enum import StrEnum
from itertools import accumulate

import msgspec

from fleet.errors import FleetError

_WAVE = re.compile(r"(\d{1,6})(%?)")
_LIMIT = re.compile(r"failed\s*>\s*(\d{1,6}(?:\.\d+)?)\s*(%?)")


class WavesError(FleetError):
    """The text of the waves or of the limit of a roll-out is invalid."""


class RolloutPhase(StrEnum):
    """Phase of a roll-out."""

    RUNNING = "running"
    STOPPED = "stopped"  # too many edges failed
    ABORTED = "aborted"  # by a person
    COMPLETED = "completed"


class RolloutEvent(StrEnum):
    """Event that moves a roll-out from one phase to another."""

    TOO_MANY_FAILED = "too many failed"
    ABORT = "abort"
    ALL_SETTLED = "all settled"


TRANSITIONS: Mapping[tuple[RolloutPhase, RolloutEvent], RolloutPhase] = {
    (RolloutPhase.RUNNING, RolloutEvent.TOO_MANY_FAILED): RolloutPhase.STOPPED,
    (RolloutPhase.RUNNING, RolloutEvent.ABORT): RolloutPhase.ABORTED,
    (RolloutPhase.RUNNING, RolloutEvent.ALL_SETTLED): RolloutPhase.COMPLETED,
}
"""Any other event changes nothing: a roll-out that has ended keeps its phase."""


class EdgeStatus(StrEnum):
    """Status of an edge with an assigned bundle; an edge without one has no entry."""

    OPEN = "open"
    DONE = "done"
    FAILED = "failed"
    OVERDUE = "overdue"  # not settled in time; it may still run the previous bundle, or part of the new one


class FailureLimit(msgspec.Struct, frozen=True):
    """Limit on failed edges: ``most`` of them, as a number or in percent of those assigned so far."""

    most: float
    percent: bool

    def is_exceeded(self, failed: int, assigned: int) -> bool:
        """Return whether too many edges have failed."""
        return failed * 100 > self.most * assigned if self.percent else failed > self.most


class Plan(msgspec.Struct, frozen=True):
    """Plan of a roll-out: its edges in order, the number of edges after each wave, the limit on failures.

    At most ``parallel`` edges change at a time. An edge that has not settled within ``within`` seconds is
    overdue, which counts as a failure.
    """

    edges: tuple[str, ...]
    ends: tuple[int, ...]
    limit: FailureLimit
    parallel: int
    within: float


class RolloutProgress(msgspec.Struct, frozen=True):
    """Progress of a roll-out.

    ``statuses``: status of each edge with an assigned bundle. ``since``: time of the assignment (Unix s).
    ``why``: reason of an early end.
    """

    phase: RolloutPhase = RolloutPhase.RUNNING
    statuses: dict[str, EdgeStatus] = msgspec.field(name="told", default_factory=dict)
    since: dict[str, float] = {}
    why: str = ""

    def count(self, what: EdgeStatus) -> int:
        """Return the number of edges with this status."""
        return sum(each is what for each in self.statuses.values())

    def not_done(self) -> list[str]:
        """Return the edges with an assigned bundle that are not done."""
        return [edge for edge, each in self.statuses.items() if each is not EdgeStatus.DONE]


def wave_ends(text: str, edges: int) -> tuple[int, ...]:
    """Return the number of edges after each wave, for a text like ``1,10%,100%``; raises WavesError.

    A share is rounded up. After the last wave it is always all edges.
    """
    matches = [_WAVE.fullmatch(part.strip()) for part in text.split(",")]
    given = [(int(each[1]), bool(each[2])) for each in matches if each is not None]
    if len(given) < len(matches):
        raise WavesError(f"{text!r} are no waves: write numbers of edges or shares of all, as 1,10%,100%")
    if any(number < 1 or (share and number > 100) for number, share in given):
        raise WavesError(f"{text!r} are no waves: a wave has at least one edge, and at most 100%")
    for kind in (True, False):
        numbers = [number for number, share in given if share is kind]
        if numbers != sorted(numbers):
            raise WavesError(f"{text!r} are no waves: each counts the edges before it too, so they only grow")
    ends = (-(-number * edges // 100) if share else number for number, share in given)
    bounded = accumulate((min(end, edges) for end in (*ends, edges)), max)
    return tuple(dict.fromkeys(bounded))


def limit_of(text: str) -> FailureLimit:
    """Parse a limit such as ``failed > 2%`` or ``failed > 3``; raises WavesError."""
    match = _LIMIT.fullmatch(text.strip())
    if match is None or (match[2] and float(match[1]) > 100):
        raise WavesError(f"{text!r} is no limit: write  failed > 2%  or  failed > 3")
    return FailureLimit(float(match[1]), bool(match[2]))


def step(
    plan: Plan, progress: RolloutProgress, seen: Mapping[str, EdgeStatus], now: float
) -> RolloutProgress:
    """Return the progress after the reported statuses; new entries of ``statuses`` get their bundle now.

    ``now`` is in Unix seconds. The status of an edge without an assigned bundle, or of one that has settled,
    is ignored.
    """
    if progress.phase is not RolloutPhase.RUNNING:
        return progress
    statuses = {name: _state(plan, progress, name, seen, now) for name in progress.statuses}
    progress = msgspec.structs.replace(progress, statuses=statuses)
    failed = progress.count(EdgeStatus.FAILED) + progress.count(EdgeStatus.OVERDUE)
    if plan.limit.is_exceeded(failed, len(statuses)):
        why = f"{failed} of {len(statuses)} edges failed: {', '.join(_failed(plan, statuses)[:5])}"
        return _moved(progress, RolloutEvent.TOO_MANY_FAILED, why)
    following = _next(plan, statuses)
    if following:
        opened = dict.fromkeys(following, EdgeStatus.OPEN)
        since = {**progress.since, **dict.fromkeys(following, now)}
        return msgspec.structs.replace(progress, statuses={**statuses, **opened}, since=since)
    if len(statuses) == len(plan.edges) and not progress.count(EdgeStatus.OPEN):
        return _moved(progress, RolloutEvent.ALL_SETTLED)
    return progress


def aborted(progress: RolloutProgress, why: str) -> RolloutProgress:
    """Return the progress after an abort by a person."""
    return _moved(progress, RolloutEvent.ABORT, why)


def _moved(progress: RolloutProgress, event: RolloutEvent, why: str = "") -> RolloutProgress:
    """Return the progress after an event; ``why`` is the reason of the end."""
    phase = TRANSITIONS.get((progress.phase, event))
    return progress if phase is None else msgspec.structs.replace(progress, phase=phase, why=why)


def _state(
    plan: Plan, progress: RolloutProgress, name: str, seen: Mapping[str, EdgeStatus], now: float
) -> EdgeStatus:
    """Return the status of an edge with an assigned bundle."""
    before = progress.statuses[name]
    if before is not EdgeStatus.OPEN:
        return before
    found = seen.get(name, EdgeStatus.OPEN)
    overdue = now - progress.since[name] > plan.within
    return EdgeStatus.OVERDUE if found is EdgeStatus.OPEN and overdue else found


def _failed(plan: Plan, statuses: Mapping[str, EdgeStatus]) -> list[str]:
    """Return the failed and overdue edges, in order."""
    return [name for name in plan.edges if statuses.get(name) in (EdgeStatus.FAILED, EdgeStatus.OVERDUE)]


def _next(plan: Plan, statuses: Mapping[str, EdgeStatus]) -> tuple[str, ...]:
    """Return the edges that get their bundle now."""
    unsettled = sum(each is EdgeStatus.OPEN for each in statuses.values())
    end = next((end for end in plan.ends if end > len(statuses)), len(statuses))
    begins_wave = len(statuses) in (0, *plan.ends)
    if begins_wave and unsettled:
        return ()
    return plan.edges[len(statuses) : min(end, len(statuses) + plan.parallel - unsettled)]
