"""Write-ahead log of started commands and stops, in a memory-mapped file, until the database has them.

A write costs a microsecond, where a synchronised write to disk costs milliseconds. The file is mapped, so a
write is not even a system call, during which other threads would take the interpreter. It is in the runtime
folder: it survives the death of the process. After a reboot, which takes longer than a command stays valid,
it is empty.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import itertools
import logging
import mmap
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

import msgspec

from fleet.errors import StateNewer
from fleet.runtime.decoding import decode_with, json_decoder
from fleet.runtime.state_format import refuse_newer

log = logging.getLogger(__name__)


class StartedCommand(msgspec.Struct, frozen=True, array_like=True, tag="begin"):
    """A command or action being executed; ``stamp`` is Unix seconds.

    ``transport`` is the transport over which its end must be reported even after a restart; empty for none.
    """

    robot: str
    identity: str
    name: str
    action: bool
    stamp: float
    transport: str = ""


class Latched(msgspec.Struct, frozen=True, array_like=True, tag="latch"):
    """An emergency stop, or with an empty ``why`` its release."""

    robot: str
    why: str


class Form(msgspec.Struct, frozen=True, array_like=True, tag="format"):
    """First row of a file: the number of its format. Files of fleet 0.1.0 have none."""

    number: int


JournalRow = StartedCommand | Latched

ANY = "*"
"""The robot name that stands for all robots, when it is unknown which were stopped."""
FORMAT = 1
_ROW: msgspec.json.Decoder[JournalRow | Form] = json_decoder(JournalRow | Form)
_encode = msgspec.json.Encoder().encode
_FIRST = _encode(Form(FORMAT)) + b"\n"

SIZE = 1 << 16  # bytes of the file, about five hundred rows; it grows while the disk takes nothing


class ExecutionJournal:
    """The file of one process, locked for the life of the process; raises OSError.

    Rows follow each other up to the first NUL. Writing the first byte therefore empties the file, whatever is
    left behind it, and a row that was cut short by death does not count.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._file = _own(path)
        try:
            self._map = _mapped(self._file, SIZE, self._path)
        except OSError:
            os.close(self._file)
            raise
        rows, _, _ = self._map[:].partition(b"\0")
        self._end = rows.rfind(b"\n") + 1
        # A half-written row or a half-done clear behind the end would otherwise become part of the next row.
        self._map[self._end :] = bytes(len(self._map) - self._end)

    def add(self, row: JournalRow) -> None:
        """Write a row; once this returns, the end of the process does not lose it."""
        line = (b"" if self._end else _FIRST) + _encode(row) + b"\n"
        end = self._end + len(line)
        if end >= len(self._map):
            self._map = _mapped(self._file, max(2 * len(self._map), end + 1), self._path)
        self._map[self._end : end] = line
        self._end = end

    @property
    def length(self) -> int:
        """Bytes of all rows."""
        return self._end

    def clear(self) -> None:
        """Remove all rows."""
        self._map[0] = 0
        self._map[: self._end] = bytes(self._end)
        self._end = 0

    def replace(self, rows: Iterable[JournalRow]) -> None:
        """Write these rows in place of all.

        The end of the process at any instruction leaves either the old ones or the new ones.
        """
        data = _FIRST + b"".join([_encode(row) + b"\n" for row in rows])
        path = self._path.with_name(f".{self._path.name}")  # no file of a process, which others read
        path.unlink(missing_ok=True)
        if not _locked(file := os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)):
            raise BlockingIOError(errno.EWOULDBLOCK, os.strerror(errno.EWOULDBLOCK), str(path))
        try:
            mapped = _mapped(file, max(SIZE, len(data) + 1), path)
            mapped[: len(data)] = data
            path.replace(self._path)
        except OSError:
            os.close(file)
            raise
        self.close()
        self._file, self._map, self._end = file, mapped, len(data)

    @contextlib.contextmanager
    def all_rows(self, *, clear: bool = True) -> Iterator[list[JournalRow]]:
        """Give the rows of all processes of this edge; an incomplete row at the end of a file is skipped.

        After the block, those of dead processes are removed, and with ``clear`` our own. Nothing else would
        remove them, and a stop among them would be set again at every start, although it was released long
        ago.
        """
        with contextlib.ExitStack() as stack:
            paths = sorted(self._path.parent.glob(f"{self._path.stem}.*"))
            others = [os.open(path, os.O_WRONLY | os.O_CLOEXEC) for path in paths if path != self._path]
            for other in others:
                stack.callback(os.close, other)
            dead = [other for other in others if _locked(other)]
            yield [row for path in paths for row in _rows(path)]
            for other in dead:
                os.ftruncate(other, 0)
            if clear:
                self.clear()
                self._make_small()

    def close(self) -> None:
        """Close the file."""
        self._map.close()
        os.close(self._file)

    def _make_small(self) -> None:
        """Give back the memory of an empty file that has grown."""
        if len(self._map) > SIZE:
            self._map.close()
            os.ftruncate(self._file, SIZE)
            self._map = _mapped(self._file, SIZE, self._path)


def _mapped(file: int, size: int, path: Path) -> mmap.mmap:
    """Return a mapped file, with at least this size.

    New bytes are written out: writing to a hole that memory has no room for would kill the process (SIGBUS).
    """
    held = os.fstat(file).st_size
    new = bytes(max(size - held, 0))
    if os.pwrite(file, new, held) < len(new):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
    return mmap.mmap(file, 0)


def execution_journal_file(directory: Path, edge: str, worker: str = "main") -> Path:
    """Return the path of a process's file; ``directory`` is the runtime folder."""
    return directory / f"begun-{edge}.{worker}"


def _own(path: Path) -> tuple[Path, int]:
    """Open and lock a process's file, or one beside it while an earlier process still has the lock.

    The lock is held for life, so that no other process takes the file for a dead one's and empties it.
    """
    beside = (path.with_name(f"{path.name}~{number}") for number in itertools.count(1))
    while not _locked(file := os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)):
        os.close(file)
        path = next(beside)
    return path, file


def _locked(file: int) -> bool:
    """Lock a file until it is closed; return False if a living process has locked it."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _rows(path: Path) -> Iterator[JournalRow]:
    """Read one file; a newer format stops every robot, since the stops in it are unknown."""
    for line in path.read_bytes().partition(b"\0")[0].splitlines():
        try:
            row = decode_with(_ROW, line)
        except msgspec.DecodeError:
            continue
        if not isinstance(row, Form):
            yield row
            continue
        try:
            refuse_newer(row.number, FORMAT)
        except StateNewer as error:
            log.error("%s cannot be read (%s): every robot is stopped", path, error)  # noqa: TRY400
            yield Latched(ANY, f"{path.name} cannot be read: {error}; whether a stop was set is unknown")
            return
