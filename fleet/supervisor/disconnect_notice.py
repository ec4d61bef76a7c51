"""What the cloud is told when an edge dies: left by the edge, told by a short-lived program of its own."""

from __future__ import annotations

import contextlib
import os
import subprocess
from collections.abc import Callable, Sequence


class DisconnectNotice:
    """``command`` tells what the file on its standard input says; empty: nobody tells anything.

    The file holds the way to the broker, credentials included: it has no name, and nothing of it is read
    here. ``told`` takes lines for people.
    """

    def __init__(self, command: Sequence[str], told: Callable[[str], None]) -> None:
        self._command = tuple(command)
        self._told = told
        self._file: int | None = None
        self._event_reporter: subprocess.Popen[bytes] | None = None

    def keep(self, descriptors: list[int]) -> None:
        """Take the file that came with a message, in place of the one before; none forgets that."""
        self.forget()
        if descriptors:
            self._file = descriptors.pop()

    def tell(self) -> None:
        """Begin to tell what was left, once; without waiting for it."""
        if self._file is None or not self._command:
            return
        try:
            os.lseek(self._file, 0, os.SEEK_SET)
            self._event_reporter = subprocess.Popen(self._command, stdin=self._file, start_new_session=True)  # noqa: S603
        except OSError as error:
            self._told(f"the cloud is not told that the edge died: {error.strerror}")
        self.forget()

    def break_off(self) -> None:
        """End the telling: the next edge is there and speaks for itself."""
        if self._event_reporter is not None:
            self._event_reporter.kill()
            self._event_reporter.wait()
            self._event_reporter = None

    def forget(self) -> None:
        """Let go of the file."""
        file, self._file = self._file, None
        if file is not None:
            with contextlib.suppress(OSError):
                os.close(file)
