"""``fleet send``, ``fleet goto`` and ``fleet stop``: asking robots from the command line."""

from __future__ import annotations

import json
import time
import uuid
from typing import Any

import click
import msgspec

from fleet.cli.connect import Edges
from fleet.cli.output import ExitCode, Output, with_output
from fleet.cli.ps import file_option
from fleet.host.safety.latch import RELEASE
from fleet.model.command import Reply, ReplyStatus
from fleet.model.state import RobotState

RECEIPT_WITHIN = 15.0  # s

wait_option = click.option("--wait", is_flag=True, help="Wait until the robot was seen to have done it.")
timeout_option = click.option(
    "--timeout", type=float, default=120.0, show_default=True, help="Seconds to wait at the most."
)


def pair(text: str) -> tuple[str, Any]:
    """Return a  key=value  argument; the value is JSON where it can be read as such, else text."""
    name, equals, value = text.partition("=")
    if not name or not equals:
        raise click.BadParameter(f"{text!r} is not key=value (as in altitude=5)")
    try:
        return name, json.loads(value)
    except ValueError:
        return name, value


@click.command()
@click.argument("robot")
@click.argument("command")
@click.argument("data", nargs=-1, metavar="[KEY=VALUE]...")
@wait_option
@timeout_option
@file_option
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
    message = {"command": command, "data": dict(pair(each) for each in data), "timestamp": time.time()}
    return _ask(out, robot, "command", message, wait=wait, timeout=timeout, file=file)


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
@file_option
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
    message: dict[str, Any] = {"command": "goto", "action_id": uuid.uuid4().hex, "timestamp": time.time()}
    if geo:
        message["geodetic_position"] = {"latitude": x, "longitude": y, "altitude": z}
    else:
        message["position"] = [x, y, z]
    if yaw is not None:
        message["yaw"] = yaw
    if speed is not None:
        message["constraints"] = {"max_speed_ms": speed}
    return _ask(out, robot, "navigate", message, wait=wait, timeout=timeout, file=file)


@click.command()
@click.argument("robots", nargs=-1)
@click.option("--all", "everything", is_flag=True, help="Every robot of every edge that runs here.")
@file_option
@with_output
def stop(out: Output, robots: tuple[str, ...], *, everything: bool, file: str | None) -> ExitCode:
    """Stop ROBOTS (or groups) at once and keep them stopped.

    This is the emergency stop: aircraft brake and hold in the air, and nothing moves until it is released
    with  fleet send ROBOT release_emergency_stop.  It never asks and never waits its turn.
    """
    if bool(robots) == everything:
        raise click.UsageError("name the robots to stop, or --all")
    with Edges.reach(file) as edges:
        stopped = edges.stop(list(robots))
        missing = [] if everything else [name for name in robots if not _covers(edges, name, stopped)]
    out.data({"stopped": stopped, "missing": missing})
    for name in stopped:
        out.say(f"{name}: stopped")
    if stopped:
        out.note(f"released with: fleet send ROBOT {RELEASE}")
    for name in missing:
        out.note(f"{name}: nobody stopped; fleet ps shows the robots there are")
    if not stopped:
        return ExitCode.REJECTED
    return ExitCode.SOME_FAILED if missing else ExitCode.OK


def _covers(edges: Edges, name: str, stopped: list[str]) -> bool:
    """Return True when a robot, or every robot of a group, was stopped."""
    if name in stopped:
        return True
    members = [member for edge in edges.edges() for member in edge.groups.get(name, [])]
    return bool(members) and set(members) <= set(stopped)


def _ask(
    out: Output,
    name: str,
    kind: str,
    message: dict[str, Any],
    *,
    wait: bool,
    timeout: float,
    file: str | None,
) -> ExitCode:
    """Ask a robot or a group; show every answer; return what they mean together."""
    payload = json.dumps(message, allow_nan=False).encode()
    within = timeout if wait else min(timeout, RECEIPT_WITHIN)
    with Edges.reach(file) as edges:
        robots = edges.named(name)
        answers = [_one(out, edges, robot, payload, kind=kind, wait=wait, timeout=within) for robot in robots]
    out.data({"answers": answers})
    codes = {_code(answer) for answer in answers}
    if len(codes) == 1:
        return codes.pop()
    return ExitCode.SOME_FAILED


def _one(
    out: Output, edges: Edges, robot: RobotState, payload: bytes, *, kind: str, wait: bool, timeout: float
) -> dict[str, Any]:
    """Ask one robot; return its last answer, for programs."""
    last = Reply(kind, ReplyStatus.TIMEOUT, f"no answer within {timeout:g} s")
    for reply in edges.command(robot, payload, kind=kind, wait=wait, timeout=timeout):
        last = reply
        out.say(f"{robot.name}: {_sentence(reply)}")
    if last.status is ReplyStatus.TIMEOUT and not last.device_result:
        out.note(f"{robot.name}: {_sentence(last)}")
    return {"robot": robot.name, **msgspec.to_builtins(last)}


def _sentence(reply: Reply) -> str:
    """Return a reply for people."""
    if reply.done:
        return f"{reply.command} done"
    words = [reply.command, reply.status.value if reply.done is None else "failed"]
    text = " ".join(words) + (f": {reply.reason}" if reply.reason else "")
    return f"{text} ({reply.hint})" if reply.hint else text


def _code(answer: dict[str, Any]) -> ExitCode:
    """Return the exit code of one robot's answer."""
    if answer["status"] == ReplyStatus.TIMEOUT.value:
        return ExitCode.TIMEOUT
    failed = answer["status"] != ReplyStatus.ACCEPTED.value or answer.get("done") is False
    return ExitCode.REJECTED if failed else ExitCode.OK
