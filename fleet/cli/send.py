"""``fleet send``: send requests to robots from the command line."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import click

from fleet.cli.common_start import CommonStartRequest, RobotReplies, at_option
from fleet.cli.completion import COMMAND, ROBOT
from fleet.cli.options import reach_option, timeout_option, wait_option
from fleet.cli.output import ExitCode, Output, summarise_answers, with_output
from fleet.cli.ps import for_programs
from fleet.client.edges import Edges
from fleet.client.local_user import stamped
from fleet.model.command import Reply, ReplyStatus
from fleet.model.state import RobotState

RECEIPT_WITHIN = 15.0  # s


def parse_argument(text: str) -> tuple[str, object]:
    """Parse a  key=value  argument; the value is JSON if possible, else text."""
    name, equals, value = text.partition("=")
    if not name or not equals:
        raise click.BadParameter(f"{text!r} is not key=value (as in altitude=5)")
    try:
        return name, json.loads(value)
    except (ValueError, RecursionError):
        return name, value


def _data(pairs: tuple[str, ...]) -> dict[str, object]:
    """Return a command's data; a repeated key is an error that must not move a robot."""
    data = dict(parse_argument(each) for each in pairs)
    if len(data) != len(pairs):
        raise click.BadParameter("a key is given twice")
    return data


@click.command()
@click.argument("robot", type=ROBOT)
@click.argument("command", type=COMMAND)
@click.argument("data", nargs=-1, metavar="[KEY=VALUE]...")
@wait_option
@timeout_option
@at_option
@reach_option
@with_output
def send(
    out: Output,
    robot: str,
    command: str,
    data: tuple[str, ...],
    *,
    wait: bool,
    timeout: float,
    at: float | None,
    file: str | None,
) -> ExitCode:
    """Send a command to ROBOT, or to every robot of a group, and show the answer.

    While an emergency stop is set, a drone still obeys  land, return_to_home, cancel_takeoff, cancel_landing
    and cancel_return_to_home,  wheeled robots and dogs obey nothing that moves them, until fleet release
    ROBOT.

    For example:  fleet send kestrel takeoff altitude=5 --wait

    With --at, all robots are prepared first, and begin at one instant; if one of them refuses, none moves.
    The start is cancelled if this command ends before, and by any stop.
    """
    message = {"command": command, "data": _data(data)}
    return request(out, robot, "command", message, wait=wait, timeout=timeout, file=file, at=at)


def _alone(_out: Output, _edges: Edges, _robots: list[RobotState]) -> contextlib.AbstractContextManager[None]:
    """Do nothing while waiting for answers."""
    return contextlib.nullcontext()


def request(
    out: Output,
    name: str,
    kind: str,
    message: dict[str, Any],
    *,
    wait: bool,
    timeout: float,
    file: str | None,
    around: Callable[[Output, Edges, list[RobotState]], contextlib.AbstractContextManager[None]] = _alone,
    at: float | None = None,
) -> ExitCode:
    """Send the same request to a robot or all of a group; show every answer; return the common exit code.

    ``message`` is stamped when it is sent, so the search for the robots does not make it older. ``around`` is
    entered while waiting for the end.
    """
    return request_each(
        out,
        name,
        kind,
        lambda _, robots: [message] * len(robots),
        wait=wait,
        timeout=timeout,
        file=file,
        around=around,
        at=at,
    )


def request_each(
    out: Output,
    name: str,
    kind: str,
    messages: Callable[[Edges, list[RobotState]], list[dict[str, object]]],
    *,
    wait: bool,
    timeout: float,
    file: str | None,
    around: Callable[[Output, Edges, list[RobotState]], contextlib.AbstractContextManager[None]] = _alone,
    at: float | None = None,
) -> ExitCode:
    """Send a robot, or each robot of a group, its own of ``messages``, which may raise Refused.

    ``at``: all begin at that instant (Unix s), or none.
    """
    within = timeout if wait else min(timeout, RECEIPT_WITHIN)
    with contextlib.ExitStack() as stack:
        edges = stack.enter_context(Edges.reach(file))
        robots = edges.named(name)
        made = _finite(messages(edges, robots))
        requested: Iterable[RobotReplies]
        if at is None:
            requested = [
                (
                    robot,
                    one["command"],
                    edges.command(robot, stamped(one), kind=kind, wait=wait, timeout=within),
                )
                for robot, one in zip(robots, made, strict=True)
            ]
        else:
            questions = [(robot, one["command"], one) for robot, one in zip(robots, made, strict=True)]
            start = stack.enter_context(CommonStartRequest(edges, questions, kind=kind, at=at))
            requested = _start_all(out, start, wait=wait, within=within)
        with around(out, edges, robots) if wait else contextlib.nullcontext():
            last = [
                (robot, last_reply(out, robot, replies, command, within))
                for robot, command, replies in requested
            ]
    if wait:
        last = [(robot, _ended(out, robot, reply, within)) for robot, reply in last]
    out.data({"answers": [{"robot": robot.name, **for_programs(reply)} for robot, reply in last]})
    return summarise_answers(out, [(robot.name, code_of(reply)) for robot, reply in last])


def _start_all(out: Output, start: CommonStartRequest, *, wait: bool, within: float) -> list[RobotReplies]:
    """Start robots at one instant, or none; return the pending answers."""
    start.check_clocks()
    answers, problems = start.run(wait=wait, within=within)
    if problems:
        first, why = next(iter(problems.items()))
        out.note(f"no robot is started: {first}: {why}")
    return answers


def _finite(messages: list[dict[str, object]]) -> list[dict[str, Any]]:
    """Return messages with finite numbers; raises UsageError for others."""
    try:
        json.dumps(messages, allow_nan=False)
    except ValueError:
        raise click.UsageError("a number in the command is not finite") from None
    return messages


def last_reply(
    out: Output, robot: RobotState, replies: Iterator[Reply], command: str, timeout: float
) -> Reply:
    """Show a robot's answers and return the last one, or a timeout without any."""
    last = None
    for last in replies:
        out.say(f"{robot.name}: {_sentence(last)}")
        if last.data is not None:
            out.say(json.dumps(last.data))
    if last is None:
        last = Reply(command, ReplyStatus.TIMEOUT, robot.cause or f"no answer within {timeout:g} s")
        out.note(f"{robot.name}: {_sentence(last)}")
    return last


def _ended(out: Output, robot: RobotState, reply: Reply, timeout: float) -> Reply:
    """Return the outcome of an awaited command; without one it is a timeout."""
    if not reply.ok or reply.done is not None:
        return reply
    late = Reply(reply.command, ReplyStatus.TIMEOUT, f"taken, but not seen to be done within {timeout:g} s")
    out.note(f"{robot.name}: {_sentence(late)}")
    return late


def _sentence(reply: Reply) -> str:
    """Return a reply as text."""
    if reply.done:
        return f"{reply.command} done"
    words = [reply.command, reply.status.value if reply.done is None else "failed"]
    reason = reply.reason.removeprefix(f"{reply.command}: ")  # refusals of data begin with the name as well
    text = " ".join(words) + (f": {reason}" if reason else "")
    return f"{text} ({reply.hint})" if reply.hint else text


def code_of(reply: Reply) -> ExitCode:
    """Return the exit code of one robot's answer."""
    if reply.status is ReplyStatus.TIMEOUT:
        return ExitCode.TIMEOUT
    return ExitCode.OK if reply.ok and reply.done is not False else ExitCode.REJECTED
