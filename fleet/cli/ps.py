"""``fleet ps``: the robots that run, and how they are."""

from __future__ import annotations

import click
import msgspec

from fleet.cli.connect import Edges
from fleet.cli.output import Output, with_output
from fleet.model.state import EdgeState, RobotState

file_option = click.option("-f", "--file", type=click.Path(), help="Reach the edge of this fleet file.")


@click.command()
@file_option
@with_output
def ps(out: Output, file: str | None) -> None:
    """Show the robots that run, and how they are.

    Asks every edge that runs on this machine, or the edge of the fleet file.
    """
    with Edges.reach(file) as edges:
        found, states = edges.edges(), edges.states()
    out.data({"edges": msgspec.to_builtins(found), "robots": msgspec.to_builtins(states)})
    out.table(
        ("robot", "health", "mode", "battery", "doing", "last command"), [_row(state) for state in states]
    )
    for state in states:
        if state.cause:
            out.say(f"{state.name}: {state.cause}")
    for edge in found:
        out.say(edge_line(edge))


def _row(state: RobotState) -> tuple[str, str, str, str, str, str]:
    """Return a robot's row."""
    last = f"{state.last_command}: {state.last_outcome}" if state.last_command else "-"
    return state.name, state.health, mode_of(state), battery_of(state), state.activity or "-", last


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
    return f"edge {edge.edge}: {edge.health}{cause}; {robots}; cloud {edge.cloud}; up {edge.uptime:.0f} s"
