"""``fleet adapters reload``: load a changed drop-in file while its robots rest."""

from __future__ import annotations

import time
from collections.abc import Sequence

import click

from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, with_output
from fleet.client.edges import Edges, UnknownRobot
from fleet.config.text import nearest
from fleet.model.state import RobotState

_ANSWER_WITHIN = 90.0  # s: the file is imported, and validates each robot's config
_BACK_WITHIN = 30.0  # s
_POLL_EVERY = 0.25  # s


@click.command("reload")
@click.argument("name")
@reach_option
@with_output
def reload(out: Output, name: str, file: str | None) -> ExitCode:
    """Load the changed drop-in file of the adapter NAME.

    The file is checked first; then the worker of its robots ends and is started again. Refused while a robot
    of that worker moves or is commanded, and for an invalid file: then the old one stays in use.
    """
    with Edges.reach(file) as edges:
        robots = _robots(edges.states(), name)
        fixed = [robot.name for robot in robots if not (robot.drop_in and robot.worker)]
        workers = sorted({(robot.edge, robot.worker) for robot in robots if robot.drop_in and robot.worker})
        if fixed:
            why = f"{', '.join(fixed)}: no drop-in file in a worker runs it; end fleet run and start it again"
            out.note(why)
        done = [_reloaded(out, edges, edge, worker, name) for edge, worker in workers]
    out.data({"reloaded": [worker for (_, worker), ok in zip(workers, done, strict=True) if ok]})
    if workers and all(done) and not fixed:
        return ExitCode.OK
    return ExitCode.SOME_FAILED if any(done) else ExitCode.REJECTED


def _robots(states: Sequence[RobotState], name: str) -> list[RobotState]:
    """Return the robots that run with an adapter; raises UnknownRobot."""
    found = [state for state in states if state.adapter == name]
    if not found:
        known = sorted({state.adapter for state in states})
        hint = nearest(name, known) or f"those of running robots are {', '.join(known) or 'none'}"
        raise UnknownRobot(f"no running robot has the adapter {name!r}", hint=hint)
    return found


def _reloaded(out: Output, edges: Edges, edge: str, worker: str, name: str) -> bool:
    """Reload one worker and wait until its robots are back; False if it refuses or they are not back."""
    reply = edges.reload(edge, worker, name, within=_ANSWER_WITHIN)
    if reply is None or not reply.ok:
        out.note(f"worker {worker}: not reloaded: {reply.reason if reply else 'it does not answer'}")
        return False
    until, gone = time.monotonic() + _BACK_WITHIN, False
    while time.monotonic() < until:
        mine = [state for state in edges.states() if (state.edge, state.worker) == (edge, worker)]
        here = bool(mine) and all(state.reachable for state in mine)
        if here and gone:
            out.say(f"worker {worker}: reloaded; running again: {', '.join(state.name for state in mine)}")
            return True
        gone = gone or not here
        time.sleep(_POLL_EVERY)
    out.note(f"worker {worker}: was started again, and its robots do not answer yet: see fleet ps")
    return False
