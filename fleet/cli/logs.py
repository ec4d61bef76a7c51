"""``fleet logs``: the logs of the edges and workers on this computer."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path

import click
import msgspec

from fleet.bus.settings import runtime_dirs
from fleet.cli.options import edge_file_option
from fleet.cli.output import Output, counted, with_output
from fleet.cli.times import since_option
from fleet.config.load import load
from fleet.errors import NotRunning
from fleet.host.logs.folders import log_folder, log_folders
from fleet.host.logs.line_format import FORMAT, LogLine, as_text
from fleet.runtime.decoding import decode_with, json_decoder
from fleet.spool.state_folder import state_folder

POLL_INTERVAL = 0.25  # s between checks for new lines
_LAST = 100
_decode = partial(decode_with, json_decoder(LogLine))


@click.command()
@click.argument("robot", required=False)
@click.option("-f", "--follow", is_flag=True, help="Follow new lines until Ctrl-C.")
@since_option
@click.option(
    "-n",
    "--last",
    type=click.IntRange(min=0),
    help=f"So many of the newest lines; left out: {_LAST}, or with --since all.",
)
@edge_file_option
@with_output
def logs(
    out: Output, robot: str | None, *, follow: bool, since: float, last: int | None, file: str | None
) -> None:
    """Show the log of the edges of this computer and their workers, or its lines about ROBOT.

    It is available while the edge runs and after its end, from level INFO on, whatever -v says. With --json
    each line is one JSON object. For the logs on board of a robot see  fleet flight-logs.
    """
    folders = _folders(file)
    if not folders:
        raise NotRunning("no edge has left a log here; another computer's is read there")
    name = (robot or "").rpartition("/")[2]
    tails: dict[Path, Tail] = {}
    before = [line for line in _more(folders, tails) if line.stamp >= since and _is_about(line, name)]
    most = len(before) if since and last is None else _LAST if last is None else last
    for line in before[max(len(before) - most, 0) :]:
        _show(out, line)
    if not before:
        out.note(f"nothing is logged{f' about {name}' if name else ''}")
    if newer := sum(tail.newer for tail in tails.values()):
        out.note(f"left out: {counted(newer, 'line')} of a newer fleet; this one reads up to format {FORMAT}")
    while follow:
        time.sleep(POLL_INTERVAL)
        for line in _more(folders, tails):
            if _is_about(line, name):
                _show(out, line)


def _more(folders: Iterable[Path], tails: dict[Path, Tail]) -> list[LogLine]:
    """Return the new lines of all processes, in order; ``tails`` are the known files."""
    for path in (path for folder in folders for path in folder.glob("*.jsonl")):
        tails.setdefault(path, Tail(path))
    return sorted((line for tail in tails.values() for line in tail.more()), key=lambda line: line.stamp)


def _show(out: Output, line: LogLine) -> None:
    """Show a line at once; for programs it is one JSON object."""
    click.echo(msgspec.json.encode(line).decode() if out.as_json else as_text(line))


class Tail:
    """One growing file with its rotated predecessors.

    ``newer`` counts the lines in a format that this version does not know.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.newer = 0
        self._inode = 0
        self._at = 0

    def more(self) -> Iterator[LogLine]:
        """Yield the new lines; the first time, all lines. An incomplete line waits for its rest."""
        try:
            found = self.path.stat()
        except OSError:
            return
        if found.st_ino != self._inode or found.st_size < self._at:
            older = sorted(self.path.parent.glob(f"{self.path.name}.*"), key=_number, reverse=True)
            yield from self._rest(older)
            self._inode, self._at = found.st_ino, 0
        whole = _content(self.path)[self._at :].rpartition(b"\n")[0]
        self._at += len(whole) + bool(whole)
        yield from self._lines(whole)

    def _rest(self, older: list[Path]) -> Iterator[LogLine]:
        """Yield the lines of rotated files: the first time all, later the rest of the last file."""
        for path in older if not self._inode else older[-1:]:
            yield from self._lines(_content(path)[self._at if self._inode else 0 :])

    def _lines(self, content: bytes) -> Iterator[LogLine]:
        """Yield the lines in a part of the file; invalid lines are skipped."""
        for each in content.splitlines():
            try:
                line = _decode(each)
            except msgspec.DecodeError:
                continue
            if line.format > FORMAT:
                self.newer += 1
            else:
                yield line


def _content(path: Path) -> bytes:
    """Return a file's content; empty if the file is gone."""
    try:
        return path.read_bytes()
    except OSError:
        return b""


def _number(path: Path) -> int:
    """Return how often a file was rotated."""
    suffix = path.suffix.removeprefix(".")
    return int(suffix) if suffix.isdecimal() else 0


def _is_about(line: LogLine, robot: str) -> bool:
    """Return True if a line is about a robot; the host's own lines begin with its name."""
    return not robot or line.robot == robot or line.message.startswith(f"{robot}: ")


def _folders(file: str | None) -> list[Path]:
    """Return the log folders: of a fleet file's edge, else of all edges of this user."""
    if file is None:
        return list(log_folders(runtime_dirs()).values())
    edge = load(file, partial=True).config.edge
    folder = log_folder(state_folder(edge.id, edge.spool.path))
    return [folder] if folder.is_dir() else []
