"""``fleet ready``: what a robot still needs before it can begin, in its own words."""

from __future__ import annotations

import click
import msgspec

from fleet.cli.ask import Asker
from fleet.cli.connect import Edges
from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, with_output
from fleet.decoding import convert
from fleet.errors import Refused

_WITHIN = 15.0  # s
_MARKS = {True: "ok", False: "no", None: "unknown"}


class _Check(msgspec.Struct):
    """One line of the answer to ``check_ready``."""

    check: str
    ok: bool | None
    words: list[str] = []


class _Answer(msgspec.Struct):
    """The answer to ``check_ready``."""

    ready: bool
    checks: list[_Check]


@click.command()
@click.argument("robot")
@reach_option
@with_output
def ready(out: Output, robot: str, *, file: str | None) -> ExitCode:
    """Show whether ROBOT would take off now: a check list with its autopilot's own words.

    Exit code 5 when something stands against it.
    """
    with Edges.reach(file) as edges:
        said = Asker(edges, robot).ask("check_ready", timeout=_WITHIN)
    try:
        answer = convert(said, _Answer)
    except msgspec.ValidationError as error:
        raise Refused(f"{robot} answers what is no check list: {error}") from None
    out.data(msgspec.to_builtins(answer))
    out.table(
        ("check", "", "words"),
        [(each.check, _MARKS[each.ok], "; ".join(each.words) or "-") for each in answer.checks],
    )
    out.say(f"{robot}: {'ready' if answer.ready else 'NOT READY'}")
    return ExitCode.OK if answer.ready else ExitCode.REJECTED
