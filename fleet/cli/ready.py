"""``fleet ready``: the missing preconditions of robots, in their own words."""

from __future__ import annotations

import click
import msgspec

from fleet.cli.completion import ROBOT
from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, summarise_answers, with_output
from fleet.cli.robot_queries import QueryResult, query_all
from fleet.client.edges import Edges
from fleet.errors import FleetError, Refused
from fleet.runtime.decoding import convert_strictly

_WITHIN = 15.0  # s
_MARKS = {True: "ok", False: "no", None: "unknown"}


class _CheckLine(msgspec.Struct):
    """One line of the answer to ``check_ready``."""

    check: str
    ok: bool | None
    words: list[str] = []


class _CheckReadyAnswer(msgspec.Struct):
    """The answer to ``check_ready``."""

    ready: bool
    checks: list[_CheckLine]


@click.command()
@click.argument("robot", type=ROBOT)
@reach_option
@with_output
def ready(out: Output, robot: str, *, file: str | None) -> ExitCode:
    """Show whether ROBOT would take off now: a check list with its autopilot's own words.

    Each robot of a group has one line, with its health and the reasons against it. Exit code 5 if there is a
    reason, 7 if there is one for some robots of a group.
    """
    with Edges.reach(file) as edges:
        answers = query_all(edges, edges.named(robot), "check_ready", timeout=_WITHIN)
    if len(answers) > 1:
        return _group(out, answers)
    answer = _checked(answers[0])
    out.data(msgspec.to_builtins(answer))
    out.table(
        ("check", "", "words"),
        [(each.check, _MARKS[each.ok], "; ".join(each.words) or "-") for each in answer.checks],
    )
    out.say(f"{robot}: {'ready' if answer.ready else 'NOT READY'}")
    return ExitCode.OK if answer.ready else ExitCode.REJECTED


def _group(out: Output, answers: list[QueryResult]) -> ExitCode:
    """Show the robots of a group, one line each."""
    rows, document, codes = [], [], []
    for each in answers:
        name, health = each.robot.name, each.robot.health
        said: dict[str, object] = {"robot": name, "health": health}
        try:
            answer = _checked(each)
        except FleetError as error:
            is_ready, words = False, str(error).removeprefix(f"{name}: ")
            said |= {"ready": None, "error": words}
        else:
            is_ready, words = answer.ready, _against(answer)
            said |= msgspec.to_builtins(answer)
        codes.append((name, ExitCode.OK if is_ready else ExitCode.REJECTED))
        document.append(said)
        rows.append((name, health, "ready" if is_ready else "NOT READY", words or "-"))
    out.data({"robots": document})
    out.table(("robot", "health", "ready", "words"), rows)
    return summarise_answers(out, codes)


def _against(answer: _CheckReadyAnswer) -> str:
    """Return the reasons against a take-off."""
    if answer.ready:
        return ""
    return "; ".join(
        f"{each.check}: {'; '.join(each.words) or _MARKS[each.ok]}" for each in answer.checks if not each.ok
    )


def _checked(answered: QueryResult) -> _CheckReadyAnswer:
    """Return the check list; raises Refused for an invalid one, TimedOut without an answer."""
    try:
        return convert_strictly(answered.get(), _CheckReadyAnswer)
    except msgspec.ValidationError as error:
        raise Refused(f"{answered.robot.name} does not answer with a check list: {error}") from None
