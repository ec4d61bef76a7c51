"""``fleet take``: take a robot out of the run of a mission."""

from __future__ import annotations

import click

from fleet.cli.completion import ROBOT
from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, with_output
from fleet.cli.send import RECEIPT_WITHIN, request


@click.command()
@click.argument("robot", type=ROBOT)
@reach_option
@with_output
def take(out: Output, robot: str, *, file: str | None) -> ExitCode:
    """Take ROBOT out of its run; it stops, and the run continues without it or ends."""
    message = {"command": "take", "data": {}}
    return request(out, robot, "command", message, wait=True, timeout=RECEIPT_WITHIN, file=file)
