"""The state folder of an edge, and the lock that gives it to one process at a time."""

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
POLL = 0.01  # s between two attempts to take a lock within a bound


def state_folder(edge: str, given: Path | None = None, environ: Mapping[str, str] = os.environ) -> Path:
    """Return the folder of an edge's durable state: ``given``, or else one of the user's (XDG) for this edge.

    It need not exist. For a user without a home, as in containers, it is below ``/``; missing permission is
    reported when the folder is created.
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


def create_folder(folder: Path) -> Path:
    """Create the folder, with access for this user only; raises StateError."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise StateError(
            f"cannot create {folder} for the edge's state: {error.strerror}; set edge.spool.path"
        ) from None
    return folder


class FileLock:
    """Exclusive lock of a file, from ``acquire`` until ``release`` or the end of the process."""

    def __init__(self, path: Path) -> None:
        self._path = path.with_name(path.name + ".lock")
        self._file: int | None = None

    def acquire(self, *, wait: bool = False) -> None:
        """Acquire the lock and write our process id into its file; raises StateTaken if it is held.

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
                f"{self._path.parent} belongs to another running edge (process {holder}); "
                "give each edge its own edge.spool.path"
            ) from None
        self._file = file
        with contextlib.suppress(OSError):  # full disk: the lock works without the process id
            os.ftruncate(file, 0)
            os.pwrite(file, f"{os.getpid()}\n".encode(), 0)

    def release(self) -> None:
        """Release the lock."""
        if self._file is not None:
            os.close(self._file)
            self._file = None


@contextlib.contextmanager
def locked(path: Path, *, within: float = math.inf) -> Iterator[None]:
    """Hold the lock of a file during a ``with`` block, after waiting for its holder.

    Raises StateTaken when another process holds it for more than ``within`` seconds, and the errors of
    ``FileLock.acquire``.
    """
    lock = FileLock(path)
    end = time.monotonic() + within
    while True:
        try:
            lock.acquire(wait=within == math.inf)
            break
        except StateTaken:
            if time.monotonic() >= end:
                raise
            time.sleep(POLL)
    try:
        yield
    finally:
        lock.release()
