"""The folder of a recording: the file in progress and finished files, of which the oldest are deleted."""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
import stat
from datetime import UTC, datetime
from pathlib import Path

from fleet.errors import StateError
from fleet.record.file import RecordingFile, repair
from fleet.record.task import MIB, Bounds

log = logging.getLogger(__name__)

SUFFIX = ".mcap"
MOST_TOPICS = 10_000  # of one file, far below the limit of MCAP


class DiskFull(StateError):
    """The disk has less room than must stay free."""


class Ring:
    """The files of one folder, which only this process writes; ``now`` is Unix seconds in each call.

    Raises StateError if the folder cannot be used or another recorder uses it.
    """

    def __init__(self, folder: Path, bounds: Bounds) -> None:
        self.folder = folder
        self._bounds = bounds
        self._lock = _locked_folder(folder)
        self._began = 0.0
        self._file: RecordingFile | None = None
        for path in files_in(folder):
            with contextlib.suppress(OSError):  # left as it is
                if repair(path):
                    log.warning("%s was cut off when its recorder ended; its last record was removed", path)

    def file(self, now: float) -> RecordingFile:
        """Return the file to write to: a new one if the one in progress is full or old.

        Raises OSError, and DiskFull if the disk has too little room.
        """
        self._check_room()
        if self._file is not None and self._is_done(self._file, now):
            self.end_file()
        if self._file is None:
            self._file = RecordingFile(_new_path(self.folder, now))
            self._began = now
            self.prune(now)
        return self._file

    def _is_done(self, file: RecordingFile, now: float) -> bool:
        """Return True if a file is full or old; a clock that was set back makes it old too."""
        bounds = self._bounds
        is_full = file.size >= bounds.file_size or file.topics >= MOST_TOPICS
        return is_full or not 0 <= now - self._began < bounds.file_age

    def _check_room(self) -> None:
        """Raise DiskFull if too little is free."""
        found = os.statvfs(self.folder)
        free = found.f_bavail * found.f_frsize
        if free < self._bounds.free:
            left, wanted = free // MIB, self._bounds.free // MIB
            raise DiskFull(f"nothing is recorded: {self.folder} has {left} MiB left, {wanted} MiB stay free")

    def prune(self, now: float) -> None:
        """Delete the oldest finished files until the others are within the limits."""
        current = self._file.path if self._file is not None else None
        kept = 0
        for path in reversed(files_in(self.folder)):
            with contextlib.suppress(OSError):  # deleted by another process
                found = path.stat()
                kept += found.st_size
                is_old = now - found.st_mtime > self._bounds.age
                if path != current and (is_old or kept > self._bounds.size):
                    path.unlink()

    def end_file(self) -> None:
        """End the file in progress; write errors are logged, the data lost."""
        file, self._file = self._file, None
        if file is not None:
            try:
                file.close()
                if file.failed:
                    repair(file.path)
            except OSError as error:
                log.warning("%s has no index: %s", file.path, error.strerror or error)

    def close(self) -> None:
        """End the file in progress, and unlock the folder."""
        self.end_file()
        os.close(self._lock)


def files_in(folder: Path) -> list[Path]:
    """Return the files of a recording, oldest first."""
    return sorted(path for path in folder.glob(f"*{SUFFIX}") if path.is_file() and not path.is_symlink())


def begin_of(path: Path) -> float | None:
    """Return the start of a file (Unix s), from its name; None for another name."""
    try:
        return datetime.strptime(path.name.partition("Z")[0] + "+0000", "%Y%m%dT%H%M%S.%f%z").timestamp()
    except ValueError:
        return None


def _new_path(folder: Path, now: float) -> Path:
    """Return the path of a file that begins now: names sort by time, UTC."""
    begins = datetime.fromtimestamp(now, UTC)
    for count in range(1000):
        path = folder / f"{begins:%Y%m%dT%H%M%S}.{begins.microsecond // 1000:03}Z-{count:03}{SUFFIX}"
        if not path.exists():
            return path
    raise StateError(f"{folder} has a thousand files of {begins}: the clock stands still")


def _locked_folder(folder: Path) -> int:
    """Create the folder for this user only, and lock it; returns the lock. Raises StateError."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.stat()
        if found.st_uid != os.getuid():
            raise StateError(f"{folder} belongs to another user; record into a folder of your own")
        if stat.S_IMODE(found.st_mode) & 0o077:
            raise StateError(f"{folder} can be read by others; chmod 700 it, or record into another folder")
        lock = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError as error:
        raise StateError(f"cannot record into {folder}: {error.strerror or error}") from None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        raise StateError(f"another recorder writes to {folder}; give each a folder of its own") from None
    return lock
