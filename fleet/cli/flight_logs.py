"""``fleet flight-logs``: a robot's onboard logs, by its commands list_logs and read_log."""

from __future__ import annotations

import base64
import binascii
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import click
import msgspec

from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, with_output
from fleet.cli.robot_queries import RobotQuery
from fleet.client.edges import Edges
from fleet.errors import Refused
from fleet.runtime.decoding import convert_strictly

_PIECE = 32 * 1024  # bytes per request
_LIST_WITHIN = 35.0  # s
_PIECE_WITHIN = 95.0  # s


class _Log(msgspec.Struct):
    """One log: its number, size in bytes, and start in Unix seconds (0: unknown)."""

    id: int
    size: int
    time: int


class _Piece(msgspec.Struct):
    """A part of a log, as base64."""

    offset: int
    data: str


@click.group("flight-logs")
@click.argument("robot")
@click.pass_context
def flight_logs(context: click.Context, robot: str) -> None:
    """List and fetch the logs that ROBOT keeps on board; it must be disarmed."""
    context.obj = robot


@flight_logs.command("list")
@reach_option
@click.pass_obj
@with_output
def list_logs(out: Output, robot: str, *, file: str | None) -> ExitCode:
    """List the logs of ROBOT."""
    with Edges.reach(file) as edges:
        found = _list(RobotQuery(edges, robot))
    out.data(msgspec.to_builtins(found))
    out.table(("log", "bytes", "begun"), [(str(log.id), str(log.size), _when(log.time)) for log in found])
    return ExitCode.OK


@flight_logs.command("get")
@click.argument("log", type=int)
@click.argument("path", metavar="[FILE]", required=False, type=click.Path(dir_okay=False, path_type=Path))
@reach_option
@click.pass_obj
@with_output
def get(out: Output, robot: str, log: int, path: Path | None, *, file: str | None) -> ExitCode:
    """Fetch a log of ROBOT to FILE (ROBOT-LOG.bin when left out).

    An interrupted download is kept as FILE.part; the same command continues it.
    """
    path = path or Path(f"{robot.rpartition('/')[2]}-{log}.bin")
    if path.exists():
        raise Refused(f"{path} exists", hint="name another file")
    with Edges.reach(file) as edges:
        query = RobotQuery(edges, robot)
        wanted = next((each for each in _list(query) if each.id == log), None)
        if wanted is None:
            raise Refused(f"{robot} has no log {log}", hint=f"fleet flight-logs {robot} list")
        _fetch(query, wanted, path)
    out.data({"file": str(path), "bytes": wanted.size})
    out.say(f"{path}: {wanted.size} bytes")
    return ExitCode.OK


def _fetch(query: RobotQuery, log: _Log, path: Path) -> None:
    """Write a log to a file, continuing an earlier attempt; shows a progress bar on a terminal."""
    part = path.with_name(f"{path.name}.part")
    done = part.stat().st_size if part.exists() else 0
    if done > log.size:
        raise Refused(f"{part} is longer than the log", hint="it is of another log: remove it")
    bar = click.progressbar(length=log.size, label=path.name, file=sys.stderr)
    with part.open("ab") as kept, bar:
        bar.update(done)
        for data in _pieces(query, log, done):
            kept.write(data)
            kept.flush()
            bar.update(len(data))
    part.replace(path)


def _pieces(query: RobotQuery, log: _Log, at: int) -> Iterator[bytes]:
    """Yield a log from an offset, piece by piece; raises Refused for a wrong piece."""
    while at < log.size:
        count = min(_PIECE, log.size - at)
        requested = {"id": log.id, "offset": at, "count": count}
        said = query.request("read_log", requested, timeout=_PIECE_WITHIN)
        try:
            piece = convert_strictly(said, _Piece)
            data = base64.b64decode(piece.data, validate=True)
        except (msgspec.ValidationError, binascii.Error) as error:
            raise Refused(f"{query.robot.name} does not answer with a log: {error}") from None
        if piece.offset != at or not 0 < len(data) <= count:
            raise Refused(f"{query.robot.name} gave {len(data)} bytes at {piece.offset}, not {count} at {at}")
        yield data
        at += len(data)


def _list(query: RobotQuery) -> list[_Log]:
    """Return the logs of a robot."""
    said = query.request("list_logs", timeout=_LIST_WITHIN)
    try:
        return convert_strictly(said, list[_Log])
    except msgspec.ValidationError as error:
        raise Refused(f"{query.robot.name} does not answer with logs: {error}") from None


def _when(seconds: int) -> str:
    """Return a time as text, in UTC."""
    return time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(seconds)) if seconds else "-"
