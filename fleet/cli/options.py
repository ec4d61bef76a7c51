"""The options and arguments that several commands have."""

from __future__ import annotations

import click

LONGEST = 86_400.0  # s


def _seconds(_context: click.Context, _option: click.Parameter, value: float) -> float:
    """Check a number of seconds; NaN is none."""
    if not 0.0 < value <= LONGEST:
        raise click.BadParameter(f"{value:g} is not within 0 and {LONGEST:g} seconds")
    return value


reach_option = click.option("-f", "--file", type=click.Path(), help="Reach the edge of this fleet file.")
"""Which edge is asked; left out: all that run on this computer."""
wait_option = click.option("--wait", is_flag=True, help="Wait until the robot was seen to have done it.")
timeout_option = click.option(
    "--timeout",
    type=float,
    default=120.0,
    show_default=True,
    callback=_seconds,
    help="Seconds to wait at the most.",
)
