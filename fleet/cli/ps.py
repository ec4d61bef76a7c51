"""``fleet ps``: the running robots and their health."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator

import click
import msgspec

from fleet.cli.options import reach_option
from fleet.cli.output import Output, with_output
from fleet.cli.overview import overview
from fleet.cli.top import look_once
from fleet.client.edges import Edges
from fleet.errors import FleetError, NotRunning
from fleet.model.state import EdgeState, RobotState

EVERY = 1.0  # s between polls of --watch


class FleetState(msgspec.Struct, frozen=True):
    """Result of one poll; ``problems`` describes the edges that did not answer."""

    edges: list[EdgeState] = []
    states: list[RobotState] = []
    problems: list[str] = []


@click.command()
@click.option("--all", "everything", is_flag=True, help="Show everything, also beyond the screen.")
@click.option("--watch", is_flag=True, help="Repeat every second until Ctrl-C; with --json one line each.")
@click.option("--site", "wide", flag_value="site", help="Show the edges of this site, by cause.")
@click.option("--fleet", "wide", flag_value="fleet", help="Show all edges that routers reach, by cause.")
@reach_option
@with_output
def ps(out: Output, *, everything: bool, watch: bool, wide: str | None, file: str | None) -> None:
    """Show the running robots and their health.

    Queries every edge that runs on this machine, or the edge of the fleet file. The worst health comes first;
    a terminal shows as many robots as fit, and the number of the others.

    SIM is sim for a simulated robot (its link begins with sim:), else real. SITE or POSITION is x y z in
    metres, in the site's frame; "own" marks one in the robot's own frame. AGE is the time since the robot's
    last message.

    With --site or --fleet one line for each cause of trouble instead, the oldest first, and one for each
    edge; `fleet top` shows the same live.
    """
    if wide and watch:
        raise click.UsageError("--watch shows robots; fleet top shows a site or a fleet live")
    if wide:
        look_once(out, file, site=wide == "site", everything=everything)
        return
    if watch:
        _watch(out, file, everything=everything)
        return
    with Edges.reach(file) as edges:
        found = _poll(edges)
    if not found.edges:
        raise NotRunning("; ".join(found.problems))
    for problem in found.problems:
        out.note(problem)
    out.data(_document(found))
    out.lines(overview(found.states, found.edges, width=out.width, height=None if everything else out.height))


def _poll(edges: Edges) -> FleetState:
    """Poll the edges once."""
    found, states = edges.edges(), edges.states()
    return FleetState(found, states, [*edges.unreached, *edges.silent(found)])


def _watch(out: Output, file: str | None, *, everything: bool) -> None:
    """Show the state repeatedly, until interrupted."""
    for found in _polls(file):
        if out.as_json:
            out.line(json.dumps(_document(found) | {"problems": found.problems}, default=str))
            continue
        height = None if everything or out.height is None else max(out.height - len(found.problems), 4)
        lines = overview(found.states, found.edges, width=out.width, height=height)
        out.screen([*found.problems, *lines])


def _polls(file: str | None) -> Iterator[FleetState]:
    """Yield the state once per second; reconnects when edges appear, disappear or fall silent."""
    while True:
        try:
            with Edges.reach(file) as edges:
                found = _poll(edges)
                while found.edges and not found.problems and edges.are_all(file):
                    yield found
                    time.sleep(EVERY)
                    found = _poll(edges)
                yield found
        except FleetError as error:
            yield FleetState(problems=[str(error)])
        time.sleep(EVERY)


def _document(found: FleetState) -> dict[str, object]:
    """Return the state for programs."""
    return {
        "edges": [for_programs(edge) for edge in found.edges],
        "robots": [for_programs(state) for state in found.states],
    }


def for_programs(value: msgspec.Struct) -> dict[str, object]:
    """Return a value with all its fields, including defaults."""
    fields: dict[str, object] = msgspec.to_builtins(msgspec.structs.asdict(value))
    return fields
