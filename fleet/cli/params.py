"""``fleet params``: robots' own parameters, by the commands get_parameters and set_parameter."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import click
import msgspec

from fleet.cli.completion import ROBOT
from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, counted, summarise_answers, with_output
from fleet.cli.parameters import read, same, shown, written
from fleet.cli.robot_queries import QueryResult, RobotQuery, query_all
from fleet.client.edges import Edges
from fleet.errors import FleetError, Refused
from fleet.runtime.decoding import convert_strictly

_ONE_WITHIN = 30.0  # s
_ALL_WITHIN = 150.0  # s; a slow radio

Found = dict[str, float | None]
Set = dict[str, float | str | None]
AnswerT = TypeVar("AnswerT")


@click.group()
@click.argument("robot", type=ROBOT)
@click.pass_context
def params(context: click.Context, robot: str) -> None:
    """Read and write the own parameters of ROBOT, or of every robot of a group (those of its autopilot)."""
    context.obj = robot


@params.command("get")
@click.argument("names", nargs=-1)
@reach_option
@click.pass_obj
@with_output
def get(out: Output, robot: str, names: tuple[str, ...], *, file: str | None) -> ExitCode:
    """Show parameters of ROBOT by name; all of them without names.

    Those of a group are ordered by parameter.
    """
    with Edges.reach(file) as edges:
        robots = edges.named(robot)
        if len(robots) == 1:
            return _get_one(out, _read(RobotQuery(edges, robot), names))
        answers = query_all(edges, robots, *_question(names), timeout=_patience(names))
    found, failed = _sorted_out(answers, Found)
    out.data({"robots": found, "failed": failed})
    if found:
        rows = [
            (which, name, shown(value)) for which, all_of in found.items() for name, value in all_of.items()
        ]
        out.table(("robot", "parameter", "value"), sorted(rows, key=lambda row: (row[1], row[0])))
    return _ended(out, found, failed)


def _get_one(out: Output, found: Found) -> ExitCode:
    """Show the parameters of one robot."""
    out.data(found)
    for name, value in found.items():
        out.say(f"{name} {shown(value)}")
    return ExitCode.OK


@params.command("set", context_settings={"ignore_unknown_options": True})
@click.argument("name")
@click.argument("value", type=float)
@click.option("--force", is_flag=True, help="Also while it is armed.")
@reach_option
@click.pass_obj
@with_output
def set_one(out: Output, robot: str, name: str, value: float, *, force: bool, file: str | None) -> ExitCode:
    """Set a parameter of ROBOT, or of every robot of a group, and read it back."""
    if value - value != 0.0:
        raise click.BadParameter("not a finite number")
    with Edges.reach(file) as edges:
        data = {"name": name, "value": value, "force": force}
        answers = query_all(edges, edges.named(robot), "set_parameter", data, timeout=_ONE_WITHIN)
    if len(answers) == 1:
        answers[0].get()  # raises the error
    done, failed = _sorted_out(answers, Set)
    out.data(answers[0].data if len(answers) == 1 else {"robots": done, "failed": failed})
    for which, answer in done.items():
        before, after = (
            each if isinstance(each, float) else None for each in map(answer.get, ("before", "after"))
        )
        of = f"{which}: " if len(answers) > 1 else ""
        out.say(f"{of}{name} {shown(after)} (was {shown(before)})")
    return _ended(out, done, failed)


@params.command("backup")
@click.argument("path", metavar="FILE", type=click.Path(dir_okay=False, path_type=Path))
@reach_option
@click.pass_obj
@with_output
def backup(out: Output, robot: str, path: Path, *, file: str | None) -> ExitCode:
    """Write all parameters of ROBOT to FILE, which must not exist yet."""
    if path.exists():
        raise Refused(f"{path} exists", hint="a backup overwrites nothing; name another file")
    with Edges.reach(file) as edges:
        found = _read(RobotQuery(edges, robot), ())
    path.write_text(written(found, f"{counted(len(found), 'parameter')} of {robot}"), encoding="utf-8")
    out.data({"file": str(path), "parameters": len(found)})
    out.say(f"{path}: {counted(len(found), 'parameter')}")
    return ExitCode.OK


@params.command("diff")
@click.argument("path", metavar="FILE", type=click.Path(dir_okay=False, path_type=Path))
@reach_option
@click.pass_obj
@with_output
def diff(out: Output, robot: str, path: Path, *, file: str | None) -> ExitCode:
    """Show the differences between the parameters of ROBOT and FILE; exit code 7 if there are any."""
    wanted = read(path)
    with Edges.reach(file) as edges:
        found = _read(RobotQuery(edges, robot), ())
    names = sorted(name for name in wanted if not same(found.get(name), wanted[name]))
    other = sorted(found.keys() - wanted.keys())
    rows = [
        (name, shown(wanted[name]), shown(found[name]) if name in found else "not there") for name in names
    ]
    changed = {name: {"file": wanted[name], "robot": found.get(name)} for name in names}
    out.data({"differ": changed, "only_robot": other})
    if rows:
        out.table(("parameter", "file", "robot"), rows)
    out.note(f"{counted(len(names), 'difference')}; {len(other)} only on {robot}")
    return ExitCode.SOME_FAILED if names else ExitCode.OK


def _question(names: tuple[str, ...]) -> tuple[str, dict[str, object]]:
    """Return the command that reads parameters, and its data."""
    return "get_parameters", {"names": list(names)} if names else {}


def _patience(names: tuple[str, ...]) -> float:
    """Return the timeout of an answer in seconds."""
    return _ONE_WITHIN if names else _ALL_WITHIN


def _read(query: RobotQuery, names: tuple[str, ...]) -> Found:
    """Return parameters by name, all without names."""
    return _checked(query.request(*_question(names), timeout=_patience(names)), Found, query.robot.name)


def _sorted_out(answers: list[QueryResult], kind: type[AnswerT]) -> tuple[dict[str, AnswerT], dict[str, str]]:
    """Return the answers of robots by name, and the errors of the others."""
    found: dict[str, AnswerT] = {}
    failed: dict[str, str] = {}
    for each in answers:
        try:
            found[each.robot.name] = _checked(each.get(), kind, each.robot.name)
        except FleetError as error:
            failed[each.robot.name] = str(error)
    return found, failed


def _ended(out: Output, found: dict[str, AnswerT], failed: dict[str, str]) -> ExitCode:
    """Report which of several robots failed; return the common exit code."""
    for why in failed.values():
        out.note(why)
    done = [(name, ExitCode.OK) for name in found]
    return summarise_answers(out, [*done, *((name, ExitCode.REJECTED) for name in failed)])


def _checked(said: object, kind: type[AnswerT], robot: str) -> AnswerT:
    """Return a valid answer; raises Refused for an invalid one."""
    try:
        return convert_strictly(said, kind)
    except msgspec.ValidationError as error:
        raise Refused(f"{robot} does not answer with parameters: {error}") from None
