"""``fleet mission``: missions that a robot carries out from its own memory, as ``mission/command`` does."""

from __future__ import annotations

import contextlib
import json
import threading
import uuid
from collections.abc import Iterator
from pathlib import Path

import click

from fleet.cli.completion import ROBOT
from fleet.cli.edges import Edges
from fleet.cli.options import reach_option, timeout_option, wait_option
from fleet.cli.output import ExitCode, Output, with_output
from fleet.cli.overview import last_of
from fleet.cli.robot_queries import RobotQuery
from fleet.cli.send import RECEIPT_WITHIN, ask
from fleet.errors import Refused
from fleet.model.state import RobotState
from fleet.wire.missions import EXECUTION

_LOOK = 1.0  # s between looks at how far it is


@click.group()
@click.argument("robot", type=ROBOT)
@click.pass_context
def mission(context: click.Context, robot: str) -> None:
    """Start and control a mission that ROBOT flies from its autopilot's own memory."""
    context.obj = robot


@mission.command("start")
@click.argument("path", metavar="FILE", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@wait_option
@timeout_option
@reach_option
@click.pass_obj
@with_output
def start(out: Output, robot: str, path: Path, *, wait: bool, timeout: float, file: str | None) -> ExitCode:
    """Give ROBOT the mission in FILE (JSON, an aerial.mission.v1) and let it begin.

    With --wait it is followed item by item to its end.
    """
    try:
        plan = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise Refused(f"{path} is no JSON: {error}") from None
    message = {"command": "start", EXECUTION: uuid.uuid4().hex, "mission": plan}
    return ask(out, robot, "mission", message, wait=wait, timeout=timeout, file=file, around=_followed)


def _control(name: str, summary: str) -> None:
    """Add a command that sends a control message of the mission's topic and waits for its end."""

    @mission.command(name, help=summary)
    @reach_option
    @click.pass_obj
    @with_output
    def control(out: Output, robot: str, *, file: str | None) -> ExitCode:
        return ask(out, robot, "mission", {"command": name}, wait=True, timeout=RECEIPT_WITHIN, file=file)


_control("pause", "Hold ROBOT where it is; resume goes on at the item.")
_control("resume", "Let ROBOT go on with the mission that was paused.")
_control("cancel", "End the mission of ROBOT: it holds where it is.")


@mission.command("clear")
@reach_option
@click.pass_obj
@with_output
def clear(out: Output, robot: str, *, file: str | None) -> ExitCode:
    """Make ROBOT forget the mission in its memory."""
    message: dict[str, object] = {"command": "clear_mission", "data": {}}
    return ask(out, robot, "command", message, wait=True, timeout=RECEIPT_WITHIN, file=file)


@mission.command("status")
@reach_option
@click.pass_obj
@with_output
def status(out: Output, robot: str, *, file: str | None) -> ExitCode:
    """Show what ROBOT is doing, and how its last command ended."""
    with Edges.reach(file) as edges:
        state = RobotQuery(edges, robot).robot
    out.data(
        {
            "robot": state.name,
            "doing": state.activity,
            "last_command": state.last_command,
            "last_outcome": state.last_outcome,
        }
    )
    out.say(f"{state.name}: {state.activity or 'nothing under way'}")
    if state.last_command:
        out.say(f"{state.name}: last command {last_of(state)}")
    return ExitCode.OK


@contextlib.contextmanager
def _followed(out: Output, edges: Edges, robots: list[RobotState]) -> Iterator[None]:
    """Show what robots are doing whenever it changes, on a thread of its own, while the block lasts."""
    over = threading.Event()
    wanted = {(robot.edge, robot.name) for robot in robots}

    def follow() -> None:
        before: dict[str, str] = {}
        while not over.wait(_LOOK):
            for state in edges.states():
                doing = state.activity
                if (state.edge, state.name) in wanted and doing and before.get(state.name) != doing:
                    before[state.name] = doing
                    out.note(f"{state.name}: {doing}")

    thread = threading.Thread(target=follow, name="fleet-follow", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
