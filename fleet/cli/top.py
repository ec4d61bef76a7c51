"""``fleet top``, ``fleet ps --site`` and ``--fleet``: all edges of a site or a fleet, by cause."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator

import click
import msgspec

from fleet.cli.options import reach_option
from fleet.cli.output import Output, with_output
from fleet.cli.site_overview import site_lines
from fleet.client.edges import site_of
from fleet.client.fleet_watch import FleetWatch, of_sites
from fleet.client.seen_edges import SeenEdges
from fleet.clock import SystemClock
from fleet.errors import NotRunning, Refused
from fleet.health.rollup import SeenEdge, roll_up

EVERY = 0.5  # s between polls
FIGURES_PORT = click.IntRange(0, 65535)


class SiteSnapshot:
    """Result of one poll, as lines and for programs."""

    def __init__(self, edges: list[SeenEdge], problems: list[str]) -> None:
        self.edges = edges
        self.problems = problems
        self.now = time.time()
        self.view = roll_up(edges, self.now)

    def lines(self, width: int | None, height: int | None) -> list[str]:
        """Return it as lines."""
        room = None if height is None else max(height - len(self.problems), 5)
        return site_lines(self.view, self.edges, self.now, width=width, height=room)

    def document(self) -> dict[str, object]:
        """Return it for programs."""
        edges: list[dict[str, object]] = [
            {
                "edge": edge.edge,
                "reach": edge.reach(self.now).value,
                "changed": edge.changed,
                "heard": edge.heard,
                "summary": edge.summary and _builtins(edge.summary),
            }
            for edge in self.edges
        ]
        return {"at": self.now, **_builtins(self.view), "each": edges, "problems": self.problems}


@click.command()
@click.option("--site/--fleet", "site", default=True, help="Edges of this site (default), or all edges.")
@click.option("--all", "everything", is_flag=True, help="Show everything, also beyond the screen.")
@click.option("--forget", metavar="EDGE", help="Remove an edge that is permanently gone.")
@click.option(
    "--metrics",
    "port",
    metavar="PORT",
    type=FIGURES_PORT,
    help="Also serve Prometheus metrics on this local port; without a terminal nothing else.",
)
@reach_option
@with_output
def top(
    out: Output, *, site: bool, everything: bool, forget: str | None, port: int | None, file: str | None
) -> None:
    """Show a whole site or fleet, live, until Ctrl-C.

    Each cause of trouble is one entry, the oldest first: since when, which robots, the chain from the robot
    over its link to the edge, and the next thing to do. An edge that is gone stays, with the time since when,
    until it is forgotten.

    The edges are those on the joined bus: of this computer, or of the fleet file. Their site is `edge.site`
    of their fleet files.
    """
    if forget is not None:
        _forget(out, file, forget)
        return
    with FleetWatch(file, SystemClock()) as watch:
        metrics = None
        if port is not None:
            from fleet.client.fleet_metrics import FleetMetrics  # noqa: PLC0415 - rarely needed

            metrics = FleetMetrics(SystemClock())
            metrics.serve(port)
        for found in _snapshots(watch, file, site=site):
            if metrics is not None:
                metrics.update(found.edges)
            if metrics is None or out.as_json or out.height is not None:
                _show(out, found, everything=everything)


def look_once(out: Output, file: str | None, *, site: bool, everything: bool) -> None:
    """Show the edges of a site or a fleet once; raises NotRunning if no bus can be joined."""
    with FleetWatch(file, SystemClock()) as watch:
        found = next(_snapshots(watch, file, site=site))
        if not watch.joined:
            raise NotRunning("; ".join(watch.problems))
    for problem in found.problems:
        out.note(problem)
    out.data(found.document())
    out.lines(found.lines(out.width, None if everything else out.height))


def _snapshots(watch: FleetWatch, file: str | None, *, site: bool) -> Iterator[SiteSnapshot]:
    """Yield the state repeatedly."""
    ours = site_of(file) if site else None
    while True:
        edges = watch.update()
        yield SiteSnapshot(of_sites(edges, watch.joined, ours) if site else edges, watch.problems)
        time.sleep(EVERY)


def _show(out: Output, found: SiteSnapshot, *, everything: bool) -> None:
    """Show one of many states."""
    if out.as_json:
        out.line(json.dumps(found.document()))
        return
    lines = found.lines(out.width, None if everything else out.height)
    out.screen([*found.problems, *lines])


def _forget(out: Output, file: str | None, edge: str) -> None:
    """Remove an edge from the list; raises Refused for an unknown one."""
    if not SeenEdges(file).forget(edge):
        raise Refused(f"no edge {edge!r} was seen on this bus")
    out.say(f"{edge} is forgotten; it is shown again once it is back")


def _builtins(value: msgspec.Struct) -> dict[str, object]:
    """Return a value in JSON types, with all its fields."""
    fields: dict[str, object] = msgspec.to_builtins(msgspec.structs.asdict(value))
    return fields
