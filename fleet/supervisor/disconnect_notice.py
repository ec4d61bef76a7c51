"""Disconnect notice for the cloud when an edge dies: left by the edge, sent by a short-lived program."""

from __future__ import annotations

import contextlib
import os
import subprocess
from collections.abc import Callable, Sequence


class DisconnectNotice:
    """Keeps a notice and runs ``command`` to send it, with the notice's file as standard input.

    An empty ``command`` sends nothing. The file holds the broker's address and credentials: it has no name,
    and its content is not read here. ``report`` takes lines for the user.
    """

    def __init__(self, command: Sequence[str], report: Callable[[str], None]) -> None:
        self._command = tuple(command)
        self._report = report
        self._file: int | None = None
        self._process: subprocess.Popen[bytes] | None = None

    def store(self, descriptors: list[int]) -> None:
        """Keep the file that came with a message, in place of the previous one; without a file, keep none."""
        self.forget()
        if descriptors:
            self._file = descriptors.pop()

    def send(self) -> None:
        """Start sending the notice, once; do not wait for the end."""
        if self._file is None or not self._command:
            return
        try:
            os.lseek(self._file, 0, os.SEEK_SET)
            self._process = subprocess.Popen(self._command, stdin=self._file, start_new_session=True)  # noqa: S603
        except OSError as error:
            self._report(f"cannot report the death of the edge to the cloud: {error.strerror}")
        self.forget()

    def abort(self) -> None:
        """Abort the sending: the next edge is up and reports its state itself."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def forget(self) -> None:
        """Close the file."""
        file, self._file = self._file, None
        if file is not None:
            with contextlib.suppress(OSError):
                os.close(file)
