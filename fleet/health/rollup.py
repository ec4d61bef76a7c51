"""Roll-up of the summaries of edges to one view of a site or fleet: causes of trouble, oldest first. Pure.

An edge is ``up``, ``silent`` (on the bus, but without recent summaries), ``gone``, or ``unseen`` (we are cut
off from its bus). An edge that was ever seen stays in the view until a person removes it.
"""

from __future__ import annotations

import enum
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import msgspec

from fleet.health.advice import advice_for
from fleet.health.causes import folded
from fleet.model.health import Level
from fleet.model.summary import NAMED, Summary, Trouble

PERIOD = 5.0
"""Seconds between two summaries of an edge without changes."""
SILENT_AFTER = 2.5 * PERIOD
LEVELS = {level.word: level for level in Level}


class Reach(enum.StrEnum):
    """Reachability of an edge."""

    UP = "up"
    SILENT = "silent"
    GONE = "gone"
    UNSEEN = "unseen"


class SeenEdge(msgspec.Struct, frozen=True):
    """View of one edge. All times are Unix s by the clock of the viewer.

    ``heard`` is the time of the last ``summary``, ``changed`` that of the last appearance or loss of its
    token; 0: never. ``unseen`` is since when we are cut off from it, 0 if we are not.
    """

    edge: str
    alive: bool
    changed: float
    summary: Summary | None = None
    heard: float = 0.0
    unseen: float = 0.0

    def reach(self, now: float) -> Reach:
        """Return whether it is up, silent, gone or unseen."""
        if not self.alive:
            return Reach.GONE
        if self.unseen:
            return Reach.UNSEEN
        return Reach.SILENT if now - max(self.heard, self.changed) > SILENT_AFTER else Reach.UP


class Row(msgspec.Struct, frozen=True):
    """One cause in the fleet: its age, the edges, and the next thing to do.

    ``robots`` have it; 0: the edges themselves. ``link`` is the link that they share.
    """

    level: str
    since: float
    what: str
    link: str
    cause: str
    edges: tuple[str, ...]
    robots: int
    names: tuple[str, ...]
    next: str


class View(msgspec.Struct, frozen=True):
    """A site or a fleet at one moment. ``more``: causes that did not fit in the summaries of edges."""

    edges: dict[str, int]
    robots: dict[str, int]
    stopped: int
    versions: dict[str, int]
    rows: list[Row]
    more: int


def roll_up(seen: Iterable[SeenEdge], now: float) -> View:
    """Return the view of some edges."""
    edges: Counter[str] = Counter()
    robots: Counter[str] = Counter()
    versions: Counter[str] = Counter()
    stopped = more = 0
    groups: dict[tuple[str, ...], list[_EdgeCause]] = {}
    for edge in seen:
        reach = edge.reach(now)
        edges[reach.value] += 1
        if edge.summary is not None:
            versions[edge.summary.version] += 1
            stopped += edge.summary.stopped
            robots += _robots_of(edge.summary, reach)
            more += edge.summary.more if reach is Reach.UP else 0
        for trouble in _troubles(edge, reach, now):
            kind = trouble.kind if trouble.robots else "edge"
            key = (reach, trouble.level, kind, trouble.link, folded(trouble.cause))
            groups.setdefault(key, []).append(_EdgeCause(edge.edge, reach, trouble))
    rows = sorted(map(_row, groups.values()), key=lambda row: (row.since, row.what))
    by_health = {word: robots[word] for word in ("unknown", *LEVELS) if robots[word]}
    return View(dict(edges), by_health, stopped, dict(versions), rows, more)


def _robots_of(summary: Summary, reach: Reach) -> Counter[str]:
    """Return the robots of an edge by health, which is unknown while the edge is not up."""
    if reach is Reach.UP:
        return Counter(summary.robots)
    return Counter({"unknown": sum(summary.robots.values())})


class _EdgeCause(NamedTuple):
    """One cause on one edge."""

    edge: str
    reach: Reach
    trouble: Trouble


def _troubles(edge: SeenEdge, reach: Reach, now: float) -> Sequence[Trouble]:
    """Return the troubles of an edge and its robots, with times by the clock of the viewer."""
    if reach is Reach.GONE:
        robots = edge.summary and sum(edge.summary.robots.values())
        cause = "not on the bus; its robots send nothing" if robots else "not on the bus"
        return (Trouble("offline", cause, min(edge.changed or edge.heard, now)),)
    if reach is Reach.SILENT:
        return (Trouble("offline", "on the bus, but it sends no summary", edge.heard or edge.changed),)
    if reach is Reach.UNSEEN:
        return (Trouble("offline", "its bus cannot be reached from here", min(edge.unseen, now)),)
    if edge.summary is None:
        return ()
    ahead = edge.summary.stamp - edge.heard
    return [
        msgspec.structs.replace(each, since=max(0.0, min(each.since - ahead, now)))
        for each in edge.summary.troubles
    ]


def _row(group: Sequence[_EdgeCause]) -> Row:
    """Return one cause with all of its edges."""
    first = min(group, key=lambda found: found.trouble.since)
    robots = sum(found.trouble.robots for found in group)
    edges = tuple(sorted(found.edge for found in group))
    names = [f"{found.edge}/{name}" for found in group for name in found.trouble.names]
    return Row(
        level=first.trouble.level,
        since=first.trouble.since,
        what=_what(first, robots, len(edges)),
        link=first.trouble.link,
        cause=first.trouble.cause,
        edges=edges,
        robots=robots,
        names=tuple(names[:NAMED]),
        next=advice_for(first.trouble, edges[0], reach=first.reach),
    )


def _what(found: _EdgeCause, robots: int, edges: int) -> str:
    """Return number, kind and state: ``3 ugv robots offline``, ``1 edge gone``."""
    trouble = found.trouble
    if not trouble.robots:
        how = trouble.level if found.reach is Reach.UP else found.reach.value
        return f"{edges} edge{'s' * (edges > 1)} {how}"
    kind = f"{trouble.kind} " if trouble.kind else ""
    return f"{robots} {kind}robot{'s' * (robots > 1)} {trouble.level}"
