"""``fleet send`` and ``fleet goto``: asking robots from the command line."""

from __future__ import annotations

import contextlib
import json
import time
import uuid
from collections.abc import Callable, Iterator
from typing import Any

import click

from fleet.cli.connect import Edges
from fleet.cli.options import reach_option, timeout_option, wait_option
from fleet.cli.output import ExitCode, Output, with_output
from fleet.cli.ps import for_programs
from fleet.model.command import Reply, ReplyStatus
from fleet.model.state import RobotState

RECEIPT_WITHIN = 15.0  # s


def pair(text: str) -> tuple[str, Any]:
    """Return a  key=value  argument; the value is JSON where it can be read as such, else text."""
    name, equals, value = text.partition("=")
    if not name or not equals:
        raise click.BadParameter(f"{text!r} is not key=value (as in altitude=5)")
    try:
        return name, json.loads(value)
    except (ValueError, RecursionError):
        return name, value


def _data(pairs: tuple[str, ...]) -> dict[str, Any]:
    """Return a command's data; a key that stands twice is a slip that must not move a robot."""
    data = dict(pair(each) for each in pairs)
    if len(data) != len(pairs):
        raise click.BadParameter("a key stands twice")
    return data


@click.command()
@click.argument("robot")
@click.argument("command")
@click.argument("data", nargs=-1, metavar="[KEY=VALUE]...")
@wait_option
@timeout_option
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
    file: str | None,
) -> ExitCode:
    """Send a command to ROBOT, or to every robot of a group, and show the answer.

    For example:  fleet send kestrel takeoff altitude=5 --wait
    """
    message = {"command": command, "data": _data(data)}
    return ask(out, robot, "command", message, wait=wait, timeout=timeout, file=file)


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("robot")
@click.argument("x", type=float)
@click.argument("y", type=float)
@click.argument("z", type=float, default=0.0)
@click.option("--yaw", type=float, help="Heading at the end, radians counter-clockwise from east.")
@click.option("--speed", type=float, help="Speed limit on the way, m/s.")
@click.option(
    "--geo", is_flag=True, help="X and Y are latitude and longitude, Z is metres above the take-off point."
)
@wait_option
@timeout_option
@reach_option
@with_output
def goto(
    out: Output,
    robot: str,
    x: float,
    y: float,
    z: float,
    *,
    yaw: float | None,
    speed: float | None,
    geo: bool,
    wait: bool,
    timeout: float,
    file: str | None,
) -> ExitCode:
    """Send ROBOT to X Y Z, metres in its world frame.

    For example:  fleet goto kestrel 10 0 5 --wait
    """
    message: dict[str, Any] = {"command": "goto", "action_id": uuid.uuid4().hex}
    if geo:
        message["geodetic_position"] = {"latitude": x, "longitude": y, "altitude": z}
    else:
        message["position"] = [x, y, z]
    if yaw is not None:
        message["yaw"] = yaw
    if speed is not None:
        message["constraints"] = {"max_speed_ms": speed}
    return ask(out, robot, "navigate", message, wait=wait, timeout=timeout, file=file)


def _alone(_out: Output, _edges: Edges, _robots: list[RobotState]) -> contextlib.AbstractContextManager[None]:
    """Do nothing while answers are waited for."""
    return contextlib.nullcontext()


def ask(
    out: Output,
    name: str,
    kind: str,
    message: dict[str, Any],
    *,
    wait: bool,
    timeout: float,
    file: str | None,
    around: Callable[[Output, Edges, list[RobotState]], contextlib.AbstractContextManager[None]] = _alone,
) -> ExitCode:
    """Ask a robot, or all of a group at once; show every answer; return what they mean together.

    ``message`` is stamped when it is sent: how long it took to find the robots does not make it older.
    ``around`` lasts while the end is waited for.
    """
    try:
        json.dumps(message, allow_nan=False)
    except ValueError:
        raise click.UsageError("a number in the command is not finite") from None
    within = timeout if wait else min(timeout, RECEIPT_WITHIN)
    with Edges.reach(file) as edges:
        robots = edges.named(name)
        asked = [
            (robot, edges.command(robot, stamped(message), kind=kind, wait=wait, timeout=within))
            for robot in robots
        ]
        with around(out, edges, robots) if wait else contextlib.nullcontext():
            last = [
                (robot, _last(out, robot, replies, message["command"], within)) for robot, replies in asked
            ]
    if wait:
        last = [(robot, _ended(out, robot, reply, within)) for robot, reply in last]
    out.data({"answers": [{"robot": robot.name, **for_programs(reply)} for robot, reply in last]})
    codes = {_code(reply) for _, reply in last}
    return codes.pop() if len(codes) == 1 else ExitCode.SOME_FAILED


def stamped(message: dict[str, Any]) -> bytes:
    """Return a message that is sent now."""
    return json.dumps({**message, "timestamp": time.time()}).encode()


def _last(out: Output, robot: RobotState, replies: Iterator[Reply], command: str, timeout: float) -> Reply:
    """Show a robot's answers and return the last of them, or that there was none."""
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
    """Return how a command ended that was waited for; without an end nobody knows."""
    if not reply.ok or reply.done is not None:
        return reply
    late = Reply(reply.command, ReplyStatus.TIMEOUT, f"taken, but not seen to be done within {timeout:g} s")
    out.note(f"{robot.name}: {_sentence(late)}")
    return late


def _sentence(reply: Reply) -> str:
    """Return a reply for people."""
    if reply.done:
        return f"{reply.command} done"
    words = [reply.command, reply.status.value if reply.done is None else "failed"]
    text = " ".join(words) + (f": {reply.reason}" if reply.reason else "")
    return f"{text} ({reply.hint})" if reply.hint else text


def _code(reply: Reply) -> ExitCode:
    """Return the exit code of one robot's answer."""
    if reply.status is ReplyStatus.TIMEOUT:
        return ExitCode.TIMEOUT
    return ExitCode.OK if reply.ok and reply.done is not False else ExitCode.REJECTED
