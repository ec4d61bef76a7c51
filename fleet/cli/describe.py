"""``fleet describe``: the commands of a robot, and whether it would accept them now."""

from __future__ import annotations

import click
import msgspec

from fleet.cli import command_text
from fleet.cli.completion import COMMAND, ROBOT
from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, summarise_answers, with_output
from fleet.client.edges import Edges
from fleet.config.text import nearest
from fleet.errors import Refused, TimedOut
from fleet.model.description import CommandDescription, RobotDescription
from fleet.model.state import RobotState


@click.command()
@click.argument("robot", type=ROBOT)
@click.argument("command", required=False, type=COMMAND)
@reach_option
@with_output
def describe(out: Output, robot: str, command: str | None, *, file: str | None) -> ExitCode:
    """Show the commands of ROBOT, and whether it would accept them now; with COMMAND, all about that one.

    The robot's own process answers, from the declarations of its adapter and the present state of its safety
    rules. A command is judged as one from this computer, without its data. A group has one line for each
    robot: the commands that it would accept or refuse now, or whether it would accept COMMAND.
    """
    with Edges.reach(file) as edges:
        robots = edges.named(robot)
        if len(robots) > 1:
            return _group(out, edges, robots, command)
        found = edges.description(robots[0])
    if command is None:
        out.data(msgspec.to_builtins(found))
        _show_all(out, found)
        return ExitCode.OK
    named = {one.name: one for one in found.commands}
    if command not in named:
        near = nearest(command, [*named, *found.verbs]) or f"fleet describe {robot} lists what it takes"
        if command in found.verbs:
            near = f"it is a verb; fleet describe {robot} shows the parameters of all verbs"
        raise Refused(f"{robot} has no command {command!r}", hint=near)
    out.data(msgspec.to_builtins(named[command]))
    _show_one(out, robot, named[command])
    return ExitCode.OK


def _group(out: Output, edges: Edges, robots: list[RobotState], command: str | None) -> ExitCode:
    """Show the robots of a group, one line each; a robot without an answer must not hide the others."""
    document: list[dict[str, object]] = []
    codes: list[tuple[str, ExitCode]] = []
    rows = []
    for robot in robots:
        try:
            found = edges.description(robot)
        except TimedOut as error:
            rows.append((robot.name, f"unknown: {error.reason}"))
            document.append({"robot": robot.name, "error": str(error)})
            codes.append((robot.name, ExitCode.TIMEOUT))
            continue
        takes, words = _in_one_line(found, command)
        rows.append((robot.name, words))
        document.append(msgspec.to_builtins(found))
        codes.append((robot.name, ExitCode.OK if takes else ExitCode.REJECTED))
    out.data({"robots": document})
    out.table(("robot", "takes now" if command is None else f"{command} now"), rows)
    return summarise_answers(out, codes)


def _in_one_line(found: RobotDescription, command: str | None) -> tuple[bool, str]:
    """Return whether a robot has a command (any, without one), and what it would accept now, as text."""
    named = {one.name: one for one in found.commands}
    if command is not None:
        return command in named, _now(named[command]) if command in named else "there is no such command"
    now = ", ".join(sorted(name for name, one in named.items() if not one.refusal)) or "nothing"
    refused = ", ".join(sorted(name for name, one in named.items() if one.refusal))
    return True, f"{now}; not now: {refused}" if refused else now


def _show_all(out: Output, found: RobotDescription) -> None:
    """Show a robot's commands, one per line, and the rest of its vocabulary."""
    rows = [
        (one.name, "no" if one.refusal else "yes", command_text.parameters(one)) for one in found.commands
    ]
    out.table(("command", "now", "parameters"), rows)
    for refusal in dict.fromkeys(one.refusal for one in found.commands if one.refusal):
        names = ", ".join(one.name for one in found.commands if one.refusal == refusal)
        out.say(f"not now: {names}: {refusal}")
    if found.verbs:
        out.say(f"verbs, with linear_x, linear_y, linear_z, angular_z or distance: {', '.join(found.verbs)}")
    if found.goals:
        refused = f"; not now: {found.goals_refusal}" if found.goals_refusal else ""
        out.say(f"goals: fleet goto {found.robot} X Y Z{refused}")
    if found.missions:
        out.say(f"missions: fleet mission run FILE --robot {found.robot}")
    if found.limits:
        limits = ", ".join(f"{name} {value:g} {_unit(name)}" for name, value in found.limits.items())
        out.say(f"limits: {limits}")


def _show_one(out: Output, robot: str, one: CommandDescription) -> None:
    """Show everything about one command."""
    out.say(
        f"fleet send {robot} {one.name}{''.join(f' {command_text.usage(each)}' for each in one.parameters)}"
    )
    command_text.show(out, one)
    out.say(f"now: {_now(one)}")


def _now(one: CommandDescription) -> str:
    """Return whether a command would be accepted."""
    return f"no: {one.refusal}" if one.refusal else "yes"


def _unit(limit: str) -> str:
    """Return the unit of a limit."""
    return {"speed": "m/s", "vertical_speed": "m/s", "yaw_rate": "rad/s"}.get(limit, "m")
