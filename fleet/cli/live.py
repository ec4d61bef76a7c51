"""The live view of ``fleet run`` and ``fleet demo``: one line a robot on a terminal, changes elsewhere."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

import msgspec

from fleet.cli.output import Output
from fleet.cli.ps import battery_of, edge_line, mode_of
from fleet.config.text import printable
from fleet.host.edge import Edge
from fleet.model.state import RobotState

if TYPE_CHECKING:
    from rich.console import Group

REFRESH = 0.5  # s
AT_ONCE = 20  # robots looked at before commands have their turn
PAUSE = 0.04  # s between so many: a thousand robots take two seconds, and one percent of a processor
STYLES = {"ok": "green", "degraded": "yellow", "offline": "red", "fault": "bold red"}


async def show(edge: Edge, out: Output) -> None:
    """Show the edge until cancelled: as a table that refreshes on a terminal, else as lines on change."""
    if sys.stdout.isatty() and not out.as_json:
        await _table(edge)
    else:
        await _lines(edge, _as_json if out.as_json else _as_text)


async def _table(edge: Edge) -> None:
    """Redraw a table in place; log lines appear above it."""
    from rich.console import Console  # noqa: PLC0415 - slow to import and only for terminals
    from rich.live import Live  # noqa: PLC0415

    # What goes to a file must not be drawn above the table instead.
    on_it = sys.stderr.isatty()
    with Live(_drawn(edge), console=Console(), auto_refresh=False, redirect_stderr=on_it) as live:
        while True:
            await asyncio.sleep(REFRESH)
            live.update(_drawn(edge), refresh=True)


def _drawn(edge: Edge) -> Group:
    """Return the table and the edge's line below it."""
    from rich.console import Group  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in ("robot", "health", "mode", "battery", "position", "doing"):
        table.add_column(heading, no_wrap=heading != "doing", overflow="ellipsis")
    for state in edge.states():
        table.add_row(
            printable(state.name),
            Text(state.health, STYLES[state.health]),
            printable(mode_of(state)),
            battery_of(state),
            _position(state),
            printable(state.cause or state.activity or state.last_outcome),
        )
    return Group(table, Text(printable(edge_line(edge.state())), "dim"))


async def _lines(edge: Edge, said: Callable[[RobotState], str]) -> None:
    """Print a line for each robot that changes."""
    before: dict[str, str] = {}
    while True:
        for number, robot in enumerate(edge.robots(), 1):
            state = robot.state()
            mark = f"{state.health} {state.cause} {mode_of(state)} {state.activity} {state.last_outcome}"
            mark += f" {state.separation}"
            if before.get(state.name) != mark:
                before[state.name] = mark
                with contextlib.suppress(OSError):  # who reads it is gone, or its disk is full
                    sys.stdout.write(f"{said(state)}\n")
                    sys.stdout.flush()
            if not number % AT_ONCE:
                await asyncio.sleep(PAUSE)
        await asyncio.sleep(REFRESH)


def _as_json(state: RobotState) -> str:
    """Return a state as one JSON line."""
    return msgspec.json.encode(state).decode()


def _as_text(state: RobotState) -> str:
    """Return a state as one line for people."""
    parts = [state.health, mode_of(state), battery_of(state), _position(state), state.activity, state.cause]
    parts.append(f"separation {state.separation}" if state.separation else "")
    return printable(f"{state.name}: " + ", ".join(part for part in parts if part and part != "-"))


def _position(state: RobotState) -> str:
    """Return where a robot is, metres."""
    if state.position is None:
        return "-"
    return f"{state.position.x:.1f} {state.position.y:.1f} {state.position.z:.1f}"
