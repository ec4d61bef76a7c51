"""``fleet ps``: the robots that run, and how they are."""

from __future__ import annotations

from collections import Counter
from typing import Any

import click
import msgspec

from fleet.cli.connect import Edges
from fleet.cli.options import reach_option
from fleet.cli.output import NotRunning, Output, counted, with_output
from fleet.model.state import EdgeState, RobotState

WORTH_TELLING = 0.2  # s that a sender's clock is off, or its way late


@click.command()
@reach_option
@with_output
def ps(out: Output, file: str | None) -> None:
    """Show the robots that run, and how they are.

    Asks every edge that runs on this machine, or the edge of the fleet file.
    """
    with Edges.reach(file) as edges:
        found, states = edges.edges(), edges.states()
        problems = [*edges.unreached, *edges.silent(found)]
    if not found:
        raise NotRunning("; ".join(problems))
    for problem in problems:
        out.note(problem)
    out.data(
        {"edges": [for_programs(edge) for edge in found], "robots": [for_programs(one) for one in states]}
    )
    named = list(zip(_names(states), states, strict=True))
    placed = any(state.site for state in states)
    columns = ("robot", "health", "mode", "battery", *(("site",) if placed else ()), "doing", "last command")
    out.table(columns, [_row(name, state, placed=placed) for name, state in named])
    for name, state in named:
        if state.cause:
            out.say(f"{name}: {state.cause}")
        for sender, offset in state.senders.items():
            if abs(offset) > WORTH_TELLING:
                out.say(f"{name}: the clock of {sender}, or its way, is {offset:.2f} s late")
        if state.drop_in and not state.worker:
            out.say(f"{name}: {state.drop_in} runs in the edge's own process (worker: main)")
        if state.separation:
            out.say(f"{name}: separation {state.separation}")
    for edge in found:
        out.say(edge_line(edge))


def for_programs(value: msgspec.Struct) -> dict[str, Any]:
    """Return a value with all its fields, also those that have their default."""
    fields: dict[str, Any] = msgspec.to_builtins(msgspec.structs.asdict(value))
    return fields


def _names(states: list[RobotState]) -> list[str]:
    """Return what the commands call each robot: with its edge where several have one of its name."""
    count = Counter(state.name for state in states)
    return [state.name if count[state.name] == 1 else f"{state.edge}/{state.name}" for state in states]


def _row(name: str, state: RobotState, *, placed: bool) -> tuple[str, ...]:
    """Return a robot's row; ``placed``: also where it is in the site's frame, metres."""
    where = (site_of(state),) if placed else ()
    known = name, state.health, mode_of(state), battery_of(state)
    return *known, *where, state.activity or "-", last_of(state)


def site_of(state: RobotState) -> str:
    """Return where a robot is in the site's frame, metres."""
    return "-" if state.site is None else f"{state.site.x:.1f} {state.site.y:.1f} {state.site.z:.1f}"


def last_of(state: RobotState) -> str:
    """Return the last command and how it ended."""
    return f"{state.last_command}: {state.last_outcome}" if state.last_command else "-"


def mode_of(state: RobotState) -> str:
    """Return mode and arming in a word or two."""
    armed = {True: " armed", False: "", None: ""}[state.armed]
    return f"{state.mode or '-'}{armed}"


def battery_of(state: RobotState) -> str:
    """Return the battery in percent."""
    return "-" if state.battery is None else f"{state.battery:.0f} %"


def edge_line(edge: EdgeState) -> str:
    """Return an edge in one line."""
    robots = ", ".join(f"{number} {word}" for word, number in edge.robots.items()) or "no robots"
    cause = f" ({edge.cause})" if edge.cause else ""
    return (
        f"edge {edge.edge}: {edge.health}{cause}; {robots}; cloud {edge.cloud}{cloud_line(edge)}; "
        f"up {edge.uptime:.0f} s"
    )


def cloud_line(edge: EdgeState) -> str:
    """Return how far the cloud is and what waits for it or was lost, as far as there is anything to say.

    States that only wait for their turn are no backlog: a newer one replaces them. Nor is what the cloud
    could take, if anybody there subscribed to it.
    """
    waiting = max(0, edge.spooled - edge.unheard)
    parts = [
        (edge.round_trip, f"{(edge.round_trip or 0) * 1000:.0f} ms away"),
        (waiting, f"{counted(waiting, 'message')} not sent yet"),
        (edge.unheard, f"{counted(edge.unheard, 'message')} kept until somebody subscribes"),
        (edge.dropped, f"{edge.dropped} dropped"),
        (edge.refused, f"{edge.refused} refused"),
    ]
    said = ", ".join(words for value, words in parts if value)
    return f" ({said})" if said else ""
