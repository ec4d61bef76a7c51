"""Listening socket of a supervisor, which listens again when its file is removed.

A running program can lose its runtime folder: logind removes that of a user who logs out, and an
administrator may clean up. Then no stop would reach the supervisor any more.
"""

from __future__ import annotations

import contextlib
import os
import selectors
import socket
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Self

from fleet.supervisor.sockets import listening

CHECK_EVERY = 1.0
"""Seconds between two checks that the file is still there."""


class SupervisorListener:
    """Listens at the first of ``paths``; after its file was removed, at the first one that is possible.

    The selector's data is a call that passes the listening socket to ``accept`` when a connection waits.
    ``report`` takes lines for the user. As a context manager it ends; raises OSError if the first path cannot
    be used.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        selector: selectors.BaseSelector,
        *,
        accept: Callable[[socket.socket], None],
        report: Callable[[str], None],
    ) -> None:
        self.path = paths[0]
        self._paths = tuple(paths)
        self._selector = selector
        self._accept = accept
        self._report = report
        self._reported = False  # that it cannot listen again
        self._checked = float("-inf")
        self._listen(self.path)

    def check(self, now: float) -> None:
        """Listen again if the file was removed; ``now`` is monotonic time, s."""
        if now - self._checked < CHECK_EVERY:
            return
        self._checked = now
        if not self._is_there():
            self._listen_again()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Stop listening, and remove the file if it is still this socket's."""
        if self._is_there():
            self.path.unlink(missing_ok=True)
        self._selector.unregister(self._socket)
        self._socket.close()

    def _is_there(self) -> bool:
        """Return whether the path still leads to this socket."""
        with contextlib.suppress(OSError):
            return _identity(self.path) == self._file
        return False

    def _listen(self, path: Path) -> None:
        """Listen at a path; raises OSError."""
        self._socket, self.path = listening(path), path
        self._file = _identity(path)
        self._selector.register(
            self._socket, selectors.EVENT_READ, lambda accept=self._accept, own=self._socket: accept(own)
        )

    def _listen_again(self) -> None:
        """Listen at the first path that is possible, and report the change once."""
        lost, old = self.path, self._socket
        for path in self._paths:
            try:
                _own_folder(path.parent)
                self._listen(path)
            except OSError as error:
                problem = f"{path}: {error.strerror or error}"
                continue
            self._selector.unregister(old)
            old.close()
            self._reported = False
            self._report(f"{lost} was removed, as at a logout; fleet stop reaches the supervisor at {path}")
            return
        if not self._reported:
            self._reported = True
            self._report(f"{lost} was removed; fleet stop cannot reach the supervisor here ({problem})")


def _identity(path: Path) -> tuple[int, int]:
    """Return what identifies a file; raises OSError."""
    found = path.lstat()
    return found.st_dev, found.st_ino


def _own_folder(folder: Path) -> None:
    """Create a folder that only this user may enter; raises OSError, also if it is another user's."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if folder.lstat().st_uid != os.getuid():
        raise PermissionError(f"{folder} belongs to another user")
