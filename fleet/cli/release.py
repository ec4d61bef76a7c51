"""``fleet release``: release emergency stops, after showing who set them, when and why."""

from __future__ import annotations

from collections.abc import Iterable

import click

from fleet.cli.history import for_programs as event_for_programs
from fleet.cli.history import who
from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, summarise_answers, with_output
from fleet.cli.ps import for_programs
from fleet.cli.send import RECEIPT_WITHIN, code_of, last_reply
from fleet.cli.times import when
from fleet.client.edges import Edges
from fleet.client.local_user import stamped
from fleet.history.event_filter import MOST, EventFilter
from fleet.history.record import Record
from fleet.history.stop_causes import stop_causes
from fleet.host.safety.emergency_stop import RELEASE
from fleet.model.command import Reply
from fleet.model.state import RobotState


@click.command()
@click.argument("robots", nargs=-1)
@click.option("--all", "everything", is_flag=True, help="Every robot whose emergency stop is set.")
@reach_option
@with_output
def release(out: Output, robots: tuple[str, ...], *, everything: bool, file: str | None) -> ExitCode:
    """Release ROBOTS (or groups) from their emergency stop, and show who set it, when and why.

    This moves nothing: they stay where they are until the next command.
    """
    if bool(robots) == everything:
        raise click.UsageError("name the robots to release, or --all")
    with Edges.reach(file) as edges:
        named = edges.states() if everything else [state for name in robots for state in edges.named(name)]
        meant = {(state.edge, state.name): state for state in named}
        stopped = [state for state in meant.values() if state.emergency_stop]
        causes = _causes(edges, stopped)
        for state in stopped:
            out.say(f"{state.name}: {_cause_words(state, causes.get((state.edge, state.name)))}")
        replies = _release(out, edges, stopped)
    for state in meant.values():
        if not state.emergency_stop and not everything:
            out.note(f"{state.name}: no emergency stop is set")
    if not stopped:
        out.note("no robot needs a release")
    released = [
        _for_programs(state, causes.get((state.edge, state.name)), reply)
        for state, reply in zip(stopped, replies, strict=True)
    ]
    out.data({"released": released})
    answered = zip(stopped, replies, strict=True)
    return summarise_answers(out, [(state.name, code_of(reply)) for state, reply in answered])


def _release(out: Output, edges: Edges, stopped: Iterable[RobotState]) -> list[Reply]:
    """Release robots concurrently; show and return their answers."""
    requested = []
    for state in stopped:
        payload = stamped({"command": RELEASE, "data": {}})
        pending = edges.command(state, payload, kind="command", wait=False, timeout=RECEIPT_WITHIN)
        requested.append((state, pending))
    return [last_reply(out, state, pending, RELEASE, RECEIPT_WITHIN) for state, pending in requested]


def _for_programs(state: RobotState, cause: Record | None, reply: Reply) -> dict[str, object]:
    """Return the result of one robot, for programs."""
    return {
        "robot": state.name,
        "edge": state.edge,
        "why": state.stop_cause,
        "stopped": event_for_programs(cause) if cause else None,
        **for_programs(reply),
    }


def _causes(edges: Edges, stopped: Iterable[RobotState]) -> dict[tuple[str, str], Record]:
    """Return the cause of each robot's stop."""
    names = tuple({state.name for state in stopped})
    return stop_causes(edges.history(EventFilter(names, 0.0, MOST))) if names else {}


def _cause_words(state: RobotState, cause: Record | None) -> str:
    """Describe who stopped a robot, when and why."""
    if cause is None:
        return f"stopped: {state.stop_cause or 'cause unknown'}"
    reason = cause.data.get("reason") or state.stop_cause or cause.text
    return f"stopped by {who(cause)}, {when(cause.stamp)}: {reason}"
