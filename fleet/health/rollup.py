"""Summaries of edges to one view of a site or a fleet: what is wrong, by cause, the oldest first. Pure.

An edge is ``up``, ``silent`` (on the bus, but no summary for a while), ``gone``, or ``unseen`` (we are cut
off from its bus ourselves). One that was ever seen stays in the view until a person forgets it.
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
"""Seconds between two summaries of an edge that nothing happens to."""
SILENT_AFTER = 2.5 * PERIOD
LEVELS = {level.word: level for level in Level}


class Reach(enum.StrEnum):
    """Whether an edge is on the bus, and tells how it is."""

    UP = "up"
    SILENT = "silent"
    GONE = "gone"
    UNSEEN = "unseen"


class SeenEdge(msgspec.Struct, frozen=True):
    """What is known of one edge. All times are Unix s by the clock of who looks.

    ``heard`` is when the last ``summary`` came, ``changed`` when its token came or went; 0: never.
    ``unseen`` is since when we are cut off from it, 0 while we are not.
    """

    edge: str
    alive: bool
    changed: float
    summary: Summary | None = None
    heard: float = 0.0
    unseen: float = 0.0

    def reach(self, now: float) -> Reach:
        """Return whether it is up, silent or gone."""
        if not self.alive:
            return Reach.GONE
        if self.unseen:
            return Reach.UNSEEN
        return Reach.SILENT if now - max(self.heard, self.changed) > SILENT_AFTER else Reach.UP


class Row(msgspec.Struct, frozen=True):
    """One cause in the fleet: what is so since when, on which edges, and what to do next.

    ``robots`` have it, none: the edges themselves. ``link`` is the part of the way that they share.
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
    """A site or a fleet at one moment. ``more``: causes for which the summaries of edges had no room."""

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
    groups: dict[tuple[str, ...], list[_Found]] = {}
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
            groups.setdefault(key, []).append(_Found(edge.edge, reach, trouble))
    rows = sorted(map(_row, groups.values()), key=lambda row: (row.since, row.what))
    by_health = {word: robots[word] for word in ("unknown", *LEVELS) if robots[word]}
    return View(dict(edges), by_health, stopped, dict(versions), rows, more)


def _robots_of(summary: Summary, reach: Reach) -> Counter[str]:
    """Return the robots of an edge by health; nobody knows that of an edge which is not heard."""
    if reach is Reach.UP:
        return Counter(summary.robots)
    return Counter({"unknown": sum(summary.robots.values())})


class _Found(NamedTuple):
    """One cause on one edge."""

    edge: str
    reach: Reach
    trouble: Trouble


def _troubles(edge: SeenEdge, reach: Reach, now: float) -> Sequence[Trouble]:
    """Return what is wrong with an edge and its robots, with times by the clock of who looks."""
    if reach is Reach.GONE:
        robots = edge.summary and sum(edge.summary.robots.values())
        cause = "not on the bus; its robots are not heard" if robots else "not on the bus"
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


def _row(group: Sequence[_Found]) -> Row:
    """Return one cause, however many edges have it."""
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


def _what(found: _Found, robots: int, edges: int) -> str:
    """Return who is how: ``3 ugv robots offline``, ``1 edge gone``."""
    trouble = found.trouble
    if not trouble.robots:
        how = trouble.level if found.reach is Reach.UP else found.reach.value
        return f"{edges} edge{'s' * (edges > 1)} {how}"
    kind = f"{trouble.kind} " if trouble.kind else ""
    return f"{robots} {kind}robot{'s' * (robots > 1)} {trouble.level}"
