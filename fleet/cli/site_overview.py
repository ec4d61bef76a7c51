"""A site or a fleet as lines that fit a screen: the causes of trouble, then the edges; pure."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Mapping, Sequence

from fleet.cli.output import GAP, counted
from fleet.cli.overview import duration
from fleet.config.text import printable
from fleet.health.rollup import LEVELS, Reach, Row, SeenEdge, View

NAMED = 3
_REACHES = (Reach.GONE, Reach.UNSEEN, Reach.SILENT, Reach.UP)
_HEADINGS = ("EDGE", "SITE", "ON THE BUS", "HEALTH", "ROBOTS", "VERSION", "UP")


def site_lines(
    view: View,
    seen: Sequence[SeenEdge],
    now: float,
    *,
    width: int | None = None,
    height: int | None = None,
) -> list[str]:
    """Return the lines; ``width`` and ``height`` are those of the screen, None without a limit.

    Causes get at least two thirds of the screen if they need it; one line is left for the prompt.
    """
    head = heading(view)
    causes = [cause_lines(row, now) for row in view.rows]
    more = [f"and {counted(view.more, 'cause')} without room in the summaries: fleet ps"] * bool(view.more)
    room = None if height is None else max(height - 1 - len(head) - len(more), 3)
    least = 0 if room is None else room // 3
    shown = _fitted(causes, None if room is None else room - min(len(seen) + 1, least))
    left = None if room is None else room - len(shown)
    lines = [*head, *shown, *more, *edge_lines(seen, now, left)]
    return [_cut(printable(line), width) for line in lines]


def heading(view: View) -> list[str]:
    """Return the numbers of edges and robots by state."""
    parts = [_counted(view.edges, "edge", _REACHES)]
    parts.append(_counted(view.robots, "robot", ("fault", "offline", "unknown", "degraded", "ok")))
    if view.stopped:
        parts.append(f"{view.stopped} with an emergency stop set")
    versions = ", ".join(f"{version} ({number})" for version, number in sorted(view.versions.items()))
    return ["; ".join(parts), f"fleet {versions}"] if len(view.versions) > 1 else ["; ".join(parts)]


def cause_lines(row: Row, now: float) -> list[str]:
    """Return one cause: age, chain from robots over link to edges; and below it the next thing to do."""
    age = duration(now - row.since) if row.since else "?"
    why = f"{row.link}: {row.cause}" if row.link else row.cause
    first = f"{age:>6}{GAP}{row.what} <- {why} <- {_listed(row.edges)}"
    return [first, f"{'':>6}{GAP}-> {row.next}"]


def edge_lines(seen: Sequence[SeenEdge], now: float, room: int | None = None) -> list[str]:
    """Return a table with a line for each edge, worst first, and the number of edges that do not fit.

    Only shown edges are formatted: of thousands of edges, a screen shows a few.
    """
    if room is None or len(seen) < room:
        return _table(seen, now)
    if room < 3:  # headings, one edge and the number of the others
        return [_missing(len(seen), "edge")]
    worst = heapq.nsmallest(room - 2, seen, key=lambda edge: _badness(edge, now))
    return [*_table(worst, now), _missing(len(seen) - len(worst), "edge")]


def _table(seen: Iterable[SeenEdge], now: float) -> list[str]:
    """Return the edges as a table, worst first."""
    ordered = sorted(seen, key=lambda edge: _badness(edge, now))
    rows = [_HEADINGS, *(_edge_row(edge, now) for edge in ordered)]
    if not any(row[1] for row in rows[1:]):
        rows = [(row[0], *row[2:]) for row in rows]
    sizes = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        GAP.join(cell.ljust(size) for cell, size in zip(row, sizes, strict=True)).rstrip() for row in rows
    ]


def _edge_row(edge: SeenEdge, now: float) -> tuple[str, ...]:
    """Return the cells of an edge."""
    reach, summary = edge.reach(now), edge.summary
    since = edge.unseen if reach is Reach.UNSEEN else edge.changed if reach is Reach.GONE else edge.heard
    word = reach.value if reach is Reach.UP or not since else f"{reach.value} for {duration(now - since)}"
    if summary is None:
        return edge.edge, "", word, "-", "-", "-", "-"
    up = reach is Reach.UP
    robots = _counts(summary.robots, reversed(LEVELS)) or "none"
    return (
        edge.edge,
        summary.site,
        word,
        summary.health if up else "-",
        robots if up else f"{sum(summary.robots.values())} unknown",
        summary.version,
        duration(summary.uptime + now - edge.heard) if up else "-",
    )


def _badness(edge: SeenEdge, now: float) -> tuple[int, int, str]:
    """Return the sort key of an edge, worst first."""
    level = LEVELS[edge.summary.health] if edge.summary else 0
    return _REACHES.index(edge.reach(now)), -level, edge.edge


def _counted(found: Mapping[str, int], word: str, order: Iterable[str]) -> str:
    """Return a total with its numbers by state."""
    counts = _counts(found, order)
    return counted(sum(found.values()), word) + (f": {counts}" if counts else "")


def _counts(found: Mapping[str, int], order: Iterable[str]) -> str:
    """Return numbers with their words, in an order."""
    return ", ".join(f"{found[word]} {word}" for word in map(str, order) if found.get(word))


def _listed(names: Sequence[str]) -> str:
    """Return the first names, and the number of the others."""
    more = len(names) - NAMED
    return ", ".join(names[:NAMED]) + (f" and {more} more" if more > 0 else "")


def _fitted(causes: Sequence[list[str]], room: int | None) -> list[str]:
    """Return as many whole causes as fit, and the number of the others."""
    if room is None or sum(map(len, causes)) <= room:
        return [line for cause in causes for line in cause]
    number = max((room - 1) // 2, 1)
    return [*(line for cause in causes[:number] for line in cause), _missing(len(causes) - number, "cause")]


def _missing(number: int, word: str) -> str:
    """Return a line with the number of omitted items."""
    return f"and {counted(number, f'more {word}')}: fleet top --all"


def _cut(text: str, width: int | None) -> str:
    """Return text truncated to the width."""
    return text if width is None or len(text) <= width else f"{text[: max(width - 1, 0)]}…"
