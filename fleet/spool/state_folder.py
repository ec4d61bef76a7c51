"""Where an edge keeps what must outlive it, and the lock that lets one process at a time have it."""

from __future__ import annotations

import contextlib
import fcntl
import math
import os
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

from fleet.errors import StateError, StateTaken

SPOOL = "spool.db"
JOURNAL = "journal.db"
LOOK = 0.01  # s between looks at a lock that is waited for within a bound


def state_folder(edge: str, given: Path | None = None, environ: Mapping[str, str] = os.environ) -> Path:
    """Return the folder of an edge's lasting state: ``given``, else one of the user's (XDG) for this edge.

    It need not exist. That of a user without a home is below ``/``, as it is in containers; who may not write
    there is told when the folder is made.
    """
    if given is not None:
        return given
    if state := environ.get("XDG_STATE_HOME"):
        return Path(state) / "fleet" / edge
    try:
        home = Path(environ.get("HOME") or Path.home())
    except RuntimeError:
        home = Path("/")
    return home / ".local" / "state" / "fleet" / edge


def made(folder: Path) -> Path:
    """Make the folder, for this user alone; raises StateError."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise StateError(
            f"cannot make {folder} for the edge's lasting state: {error.strerror}; set edge.spool.path"
        ) from None
    return folder


class FileLock:
    """The right to a file, from ``taken`` until ``let_go`` or the end of the process, however it ends."""

    def __init__(self, path: Path) -> None:
        self._path = path.with_name(path.name + ".lock")
        self._file: int | None = None

    def take(self, *, wait: bool = False) -> None:
        """Take the lock, and write our process id beside it; raises StateTaken when another has it.

        Raises StateError when the lock's file cannot be opened.
        """
        try:
            file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except OSError as error:
            raise StateError(f"cannot open {self._path}: {error.strerror}; set edge.spool.path") from None
        try:
            fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            holder = os.pread(file, 20, 0).decode(errors="replace").strip() or "unknown"
            os.close(file)
            raise StateTaken(
                f"{self._path.parent} belongs to another edge that runs (process {holder}); "
                "give each edge its own edge.spool.path"
            ) from None
        self._file = file
        with contextlib.suppress(OSError):  # a full disk: the lock holds without the number
            os.ftruncate(file, 0)
            os.pwrite(file, f"{os.getpid()}\n".encode(), 0)

    def let_go(self) -> None:
        """Give the lock back."""
        if self._file is not None:
            os.close(self._file)
            self._file = None


@contextlib.contextmanager
def locked(path: Path, *, within: float = math.inf) -> Iterator[None]:
    """Have the lock of a file for as long as a ``with`` block lasts, waiting for whoever has it.

    Raises StateTaken when another process keeps it for more than ``within`` seconds, and what
    ``FileLock.take`` raises.
    """
    lock = FileLock(path)
    end = time.monotonic() + within
    while True:
        try:
            lock.take(wait=within == math.inf)
            break
        except StateTaken:
            if time.monotonic() >= end:
                raise
            time.sleep(LOOK)
    try:
        yield
    finally:
        lock.let_go()
