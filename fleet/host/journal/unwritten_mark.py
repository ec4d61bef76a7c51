"""Mark in the state folder of an edge: a stop was set that the journal's database may not have.

The execution journal has that stop too, but a reboot empties it. A file can still be created on most disks
on which the database cannot be written: full ones, and where the database itself cannot be opened.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable
from pathlib import Path

from fleet.spool.state_folder import JOURNAL

_PREFIX = f"{JOURNAL}.unwritten-"


class UnwrittenMark:
    """The mark of one process, whose execution journal is called ``name``. Never raises."""

    def __init__(self, folder: Path, name: str) -> None:
        self._path = folder / f"{_PREFIX}{name}"
        self._ours = False  # set by this process; one of an earlier process counts until a database is open

    @property
    def others(self) -> list[Path]:
        """The marks of other and of earlier processes."""
        with contextlib.suppress(OSError):
            found = sorted(self._path.parent.glob(f"{_PREFIX}*"))
            return [path for path in found if not (self._ours and path == self._path)]
        return []

    def put(self, *, unwritten: bool) -> None:
        """Set the mark if a stop that is set is ``unwritten``, else remove it."""
        if unwritten == self._ours:
            return
        with contextlib.suppress(OSError):
            if unwritten:
                os.close(os.open(self._path, os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600))
            else:
                self._path.unlink(missing_ok=True)
            self._ours = unwritten
            if unwritten:
                _synchronise(self._path.parent)


def remove(marks: Iterable[Path]) -> None:
    """Remove marks, after the database has their stops; one that stays stops the robots once more."""
    for path in marks:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)


def _synchronise(folder: Path) -> None:
    """Write a folder's entries to the medium."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
