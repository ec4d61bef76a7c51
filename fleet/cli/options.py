"""Options and arguments shared by several commands."""

from __future__ import annotations

from collections.abc import Callable

import click

LONGEST = 86_400.0  # s


def _seconds(_context: click.Context, _option: click.Parameter, value: float) -> float:
    """Check a number of seconds; also refuses NaN."""
    if not 0.0 < value <= LONGEST:
        raise click.BadParameter(f"{value:g} is not within 0 and {LONGEST:g} seconds")
    return value


reach_option = click.option("-f", "--file", type=click.Path(), help="Reach the edge of this fleet file.")
"""Selects the edge; left out: all that run on this computer."""
edge_file_option = click.option(
    "--file", type=click.Path(), help="Only the edge of this fleet file; needed where edge.spool.path is set."
)
"""Selects the edge where -f means to follow."""
wait_option = click.option("--wait", is_flag=True, help="Wait until the robot is seen to have done it.")
timeout_option = click.option(
    "--timeout",
    type=float,
    default=120.0,
    show_default=True,
    callback=_seconds,
    help="Maximum wait in seconds.",
)


def log_options(function: Callable[..., object]) -> Callable[..., object]:
    """Add the log options to a command that runs an edge."""
    for option in (
        click.option(
            "--log-format",
            type=click.Choice(["text", "json"]),
            default="text",
            show_default=True,
            help="Lines for people, or one JSON object per line.",
        ),
        click.option(
            "--log-file", type=click.Path(dir_okay=False), help="Also log to this file; it is rotated."
        ),
        click.option("-v", "--verbose", count=True, help="Log more; twice for everything."),
    ):
        function = option(function)
    return function
