"""``fleet history``: requests to robots, their senders and outcomes."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import click
import msgspec

from fleet.bus.settings import client_dirs, is_running
from fleet.cli.options import reach_option
from fleet.cli.output import Output, with_output
from fleet.cli.times import iso, since_option, when
from fleet.client.edges import Edges, UnknownRobot
from fleet.errors import BusError, NotRunning, StateError
from fleet.history.event_filter import MOST, EventFilter, newest
from fleet.history.reader import read
from fleet.history.record import Record
from fleet.history.store import HISTORY
from fleet.spool.state_folder import state_folder

_LAST = 100


@click.command()
@click.argument("robot", required=False)
@since_option
@click.option(
    "-n",
    "--last",
    type=click.IntRange(1, MOST),
    default=None,
    help=f"So many of the newest events; left out: {_LAST}, or with --since all ({MOST} at most).",
)
@reach_option
@with_output
def history(out: Output, robot: str | None, *, since: float, last: int | None, file: str | None) -> None:
    """Show the commands to ROBOT (or to a group, or to all), their senders and outcomes, the newest last.

    A running edge answers; otherwise its file is read, which needs -f only if edge.spool.path is set. A
    requester is proven if the transport authenticates the name, else claimed by the message.

    Events: command and outcome belong to one request, found and lost say that the robot answers or no longer
    answers, health is a change of its health.
    """
    most = last or (MOST if since else _LAST)
    found = _found(robot, since, most, file)
    out.data([for_programs(record) for record in found])
    several = len({each.edge for each in found}) > 1
    rows = [
        (
            when(each.stamp),
            f"{each.edge}/{each.robot}" if several else each.robot,
            each.kind.value,
            who(each),
            each.text,
        )
        for each in found
    ]
    if rows:
        out.table(("time", "robot", "event", "requester", "what"), rows)
    else:
        out.note("nothing is known")


def _found(robot: str | None, since: float, most: int, file: str | None) -> list[Record]:
    """Return the events from the running edges, or from the files if none runs."""
    wanted = EventFilter((robot,) if robot else (), since, most)
    try:
        with Edges.reach(file) as edges:
            from_edges = _from_edges(edges, robot, since, most)
    except (NotRunning, BusError):
        folders = _folders(file)
        if not any((folder / HISTORY).exists() for folder in folders):
            raise
        return _read(folders, wanted)
    if file is None or robot is not None:
        return from_edges
    return newest([*from_edges, *_read(_folders(file, running=False), wanted)], wanted)


def _read(folders: Iterable[Path], wanted: EventFilter) -> list[Record]:
    """Return the events in files; raises StateError if none can be read."""
    records: list[Record] = []
    problems: list[StateError] = []
    for folder in folders:
        with _collected_error(problems):
            found = read(folder, wanted)
            records += [msgspec.structs.replace(record, edge=folder.name) for record in found]
    if problems and not records:
        raise problems[0]
    return newest(records, wanted)


def _from_edges(edges: Edges, robot: str | None, since: float, most: int) -> list[Record]:
    """Return the events from running edges, also of a removed robot. Raises UnknownRobot."""
    if robot is None:
        return edges.history(EventFilter((), since, most))
    try:
        meant = {(state.edge, state.name) for state in edges.named(robot)}
    except UnknownRobot:
        found = edges.history(EventFilter((robot,), since, most))
        if not found:
            raise
        return found
    names = tuple({name for _, name in meant})
    return [
        each for each in edges.history(EventFilter(names, since, most)) if (each.edge, each.robot) in meant
    ]


@contextlib.contextmanager
def _collected_error(problems: list[StateError]) -> Iterator[None]:
    """Collect the error of a file, so that the other files are still read."""
    try:
        yield
    except StateError as error:
        problems.append(error)


def _folders(
    file: str | None, environ: Mapping[str, str] = os.environ, *, running: bool = True
) -> list[Path]:
    """Return the state folders: of a fleet file's edge, else of all edges of this user.

    Not ``running``: empty if the edge runs here, because it sends its history itself. A console without an
    edge writes its logins there.
    """
    if file is None:
        return sorted(state_folder("edge", environ=environ).parent.glob("*/"))
    from fleet.config.load import sections_of  # noqa: PLC0415 - pydantic is not needed without a file

    edge = sections_of(file, environ).edge
    if not running and any(is_running(edge.id, each) for each in client_dirs(environ)):
        return []
    return [state_folder(edge.id, edge.spool.path, environ)]


def who(record: Record) -> str:
    """Return the requester of an event, as text."""
    requester = record.asker
    if requester is None:
        return "-"
    known = "proven" if requester.proven else "claimed"
    name = requester.name or requester.source_type or "unknown sender"
    return f"{name} ({known}, {requester.transport.value})"


def for_programs(record: Record) -> dict[str, object]:
    """Return an event for programs; ``time`` is its stamp with date and zone."""
    return {"time": iso(record.stamp), **msgspec.to_builtins(record)}
