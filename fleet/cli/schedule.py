"""``fleet schedule``: show, enable and disable the schedules of missions."""

from __future__ import annotations

import itertools
import time
from typing import Any, Literal

import click
import msgspec

from fleet.cli.completion import SCHEDULE
from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, with_output
from fleet.cli.times import iso, when
from fleet.client.edges import Edges
from fleet.client.local_user import local_user
from fleet.errors import Refused
from fleet.model.schedule import Firing, ScheduleRequest, ScheduleState

ScheduleAction = Literal["enable", "disable", "run"]


@click.group()
def schedule() -> None:
    """Show, enable and disable automatic starts of missions (schedules: in fleet.yaml)."""


@schedule.command("ls")
@reach_option
@with_output
def list_all(out: Output, *, file: str | None) -> ExitCode:
    """Show the schedules of the running edges: when each fires next, and its last result."""
    with Edges.reach(file) as edges:
        found = edges.schedules()
    out.data([{"edge": edge, **_for_programs(state)} for edge, state in found])
    rows = [
        (
            state.name,
            state.mission,
            state.trigger,
            "on" if state.enabled else "off",
            when(state.next) if state.next is not None else "-",
            _last(state),
        )
        for _, state in found
    ]
    if rows:
        out.table(("schedule", "mission", "fires", "is", "next", "last"), rows)
    else:
        out.note("there are no schedules; schedules: in fleet.yaml")
    return ExitCode.OK


@schedule.command("next")
@click.argument("name", required=False, type=SCHEDULE)
@click.option("-n", "--number", type=click.IntRange(1, 1000), default=5, show_default=True)
@click.option(
    "-f",
    "--file",
    type=click.Path(exists=True, dir_okay=False),
    default="fleet.yaml",
    show_default=True,
    help="The fleet file; no edge needs to run.",
)
@with_output
def next_ones(out: Output, *, name: str | None, number: int, file: str) -> ExitCode:
    """Show when the schedules of a fleet file, or NAME of them, fire next, in order of time."""
    from fleet.config.load import sections_of  # noqa: PLC0415 - pydantic is not needed by the others
    from fleet.schedules.triggers import firings  # noqa: PLC0415

    configs = sections_of(file).schedules
    if name is not None and name not in configs:
        raise Refused(f"there is no schedule {name!r}", hint=f"there are: {', '.join(configs) or 'none'}")
    now = time.time()
    found = sorted(
        (at, one)
        for one, config in configs.items()
        if name in (None, one) and config.trigger is not None and config.enabled
        for at in itertools.islice(firings(config.trigger, now), number)
    )[:number]
    out.data([{"time": iso(at), "stamp": at, "schedule": one} for at, one in found])
    rows = [(when(at), one, configs[one].mission) for at, one in found]
    if rows:
        out.table(("time", "schedule", "mission"), rows)
    else:
        out.note("nothing fires by the clock")
    return ExitCode.OK


def _requesting(do: ScheduleAction, summary: str, done: str) -> None:
    """Add a command that sends a request about one schedule."""

    @schedule.command(do, help=summary)
    @click.argument("name", type=SCHEDULE)
    @reach_option
    @with_output
    def request(out: Output, *, name: str, file: str | None) -> ExitCode:
        with Edges.reach(file) as edges:
            edge, plain = _one(edges, name)
            answer = edges.request_schedules(edge, ScheduleRequest(do, plain, local_user()))
        if answer.refusal:
            raise Refused(f"{plain}: {answer.refusal}")
        (state,) = [state for state in answer.schedules if state.name == plain]
        out.data({"edge": edge, **_for_programs(state)})
        out.say(f"{plain}: {done}{f' as {state.last[0].run}' if do == 'run' and state.last else ''}")
        return ExitCode.OK


_requesting("enable", "Enable NAME; firings missed meanwhile are not made up for.", "enabled")
_requesting("disable", "Disable NAME until it is enabled again, also after a restart.", "disabled")
_requesting("run", "Fire NAME now, even if it is disabled.", "started")


def _one(edges: Edges, name: str) -> tuple[str, str]:
    """Return the edge and the name of one schedule; raises Refused for none and for several."""
    known = edges.schedules()
    found = [(edge, one.name) for edge, one in known if name in (one.name, f"{edge}/{one.name}")]
    if len(found) > 1:
        which = ", ".join(f"{edge}/{one}" for edge, one in found)
        raise Refused(f"there are several schedules {name!r}", hint=f"say which one: {which}")
    if not found:
        there = ", ".join(one.name for _, one in known) or "none"
        raise Refused(f"there is no schedule {name!r}", hint=f"there are: {there}")
    return found[0]


def _last(state: ScheduleState) -> str:
    """Return the result of the last firing, as text."""
    if state.waiting is not None:
        return f"waits since {when(state.waiting)}"
    return _words(state.last[0]) if state.last else "-"


def _words(firing: Firing) -> str:
    """Return the result of a firing, as text."""
    words = firing.reason if firing.state == "skipped" else firing.run
    return f"{when(firing.due)} {firing.state}" + f": {words}" * bool(words)


def _for_programs(state: ScheduleState) -> dict[str, Any]:
    """Return a schedule for programs."""
    document: dict[str, Any] = msgspec.to_builtins(state)
    return document | {"next_time": iso(state.next) if state.next is not None else None}
