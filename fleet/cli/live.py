"""Live view of ``fleet run`` and ``fleet demo``: a table on a terminal, changes as lines elsewhere."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

import msgspec

from fleet.cli.output import COLORS, Output
from fleet.cli.overview import battery_of, mode_of, overview, place_of
from fleet.config.text import printable
from fleet.host.edge.edge import Edge
from fleet.model.state import RobotState

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

REFRESH = 0.5  # s
AT_ONCE = 20  # robots processed before other tasks run
PAUSE = 0.04  # s between such batches: a thousand robots take two seconds, and one percent of a processor


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

    console = Console()
    # Logs redirected to a file must not be drawn above the table instead.
    on_it = sys.stderr.isatty()
    with Live(_drawn(edge, console), console=console, auto_refresh=False, redirect_stderr=on_it) as live:
        while True:
            await asyncio.sleep(REFRESH)
            live.update(_drawn(edge, console), refresh=True)


def _drawn(edge: Edge, console: Console) -> Text:
    """Return the present output of ``fleet ps``, as much as fits."""
    from rich.text import Text  # noqa: PLC0415

    width, height = console.size
    lines = overview(edge.states(), [edge.state()], width=width, height=height)
    text = Text("\n".join(lines), no_wrap=True, overflow="ellipsis")
    for word, color in COLORS.items():
        text.highlight_regex(rf"(?<!\S){word}(?!\S)", color)
    return text


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
                with contextlib.suppress(OSError):  # the reader is gone, or its disk is full
                    sys.stdout.write(f"{said(state)}\n")
                    sys.stdout.flush()
            if not number % AT_ONCE:
                await asyncio.sleep(PAUSE)
        await asyncio.sleep(REFRESH)


def _as_json(state: RobotState) -> str:
    """Return a state as one JSON line."""
    return msgspec.json.encode(state).decode()


def _as_text(state: RobotState) -> str:
    """Return a state as one line of text."""
    parts = [state.health, mode_of(state), battery_of(state), place_of(state), state.activity, state.cause]
    parts.append(f"separation {state.separation}" if state.separation else "")
    return printable(f"{state.name}: " + ", ".join(part for part in parts if part and part != "-"))
