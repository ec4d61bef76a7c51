"""Log file with rotation, written by its own thread, so that a slow or full disk delays nothing."""

from __future__ import annotations

import contextlib
import logging
import os
import threading
import time
from collections import deque
from pathlib import Path

SIZE = 8 << 20  # bytes after which a file is rotated
KEEP = 5  # rotated files
WAITING = 10_000  # lines in memory at most
POLL_INTERVAL = 0.005  # s between checks that the last lines are written
AGAIN_AFTER = 5.0  # s until a failed disk is tried again


class RotatingLogFile(logging.Handler):
    """Writes lines to ``path``; older files are ``path.1`` and up. Never raises, never waits.

    ``problem`` is why lines are not written, empty while they are; ``lost`` counts lines without room.
    """

    def __init__(
        self, path: Path, formatter: logging.Formatter, *, size: int = SIZE, keep: int = KEEP
    ) -> None:
        super().__init__()
        self.setFormatter(formatter)
        self.problem = ""
        self.lost = 0
        self._path = path
        self._size = size
        self._keep = keep
        self._waiting: deque[str] = deque()
        self._something = threading.Event()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="fleet-log", daemon=True)
        self._thread.start()

    def emit(self, record: logging.LogRecord) -> None:
        """Queue a line; from any thread. A stop may be logged, so this never waits for the disk."""
        try:
            line = self.format(record)
        except Exception:  # noqa: BLE001 - a line that cannot be formatted must not raise
            self.handleError(record)
            return
        if len(self._waiting) >= WAITING:
            self.lost += 1
            return
        self._waiting.append(line)
        self._something.set()

    @property
    def waiting(self) -> bool:
        """True while a line is not in the file yet."""
        return bool(self._waiting)

    def close(self) -> None:
        """Write all queued lines, and end."""
        self._closing.set()
        self._something.set()
        self._thread.join(2.0)
        super().close()

    def _run(self) -> None:
        """Thread: write lines as they arrive."""
        while not self._closing.is_set():
            self._something.wait()
            self._something.clear()
            while not self._write():
                if self._closing.wait(AGAIN_AFTER):
                    return
        self._write()  # lines queued during the last write

    def _write(self) -> bool:
        """Write all queued lines; return whether the disk accepted them."""
        lines = list(self._waiting)
        if not lines:
            return True
        try:
            self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._rotate()
            _append(self._path, "".join(f"{line}\n" for line in lines).encode(errors="backslashreplace"))
        except OSError as error:
            self.problem = f"the log is not written: {error}"
            return False
        for _ in lines:
            self._waiting.popleft()
        self.problem = ""
        return True

    def _rotate(self) -> None:
        """Start a new file when this one is full."""
        with contextlib.suppress(FileNotFoundError):
            if self._path.stat().st_size >= self._size:
                for number in range(self._keep - 1, 0, -1):
                    with contextlib.suppress(FileNotFoundError):
                        rotated(self._path, number).replace(rotated(self._path, number + 1))
                self._path.replace(rotated(self._path, 1))


def log_and_flush(log: logging.Logger, text: str, *, within: float) -> None:
    """Log why this process ends at once, and wait at most ``within`` seconds until the log files have it."""
    end = time.monotonic() + within
    log.critical("%s", text)
    files = [each for each in logging.getLogger().handlers if isinstance(each, RotatingLogFile)]
    while any(file.waiting for file in files) and time.monotonic() < end:
        time.sleep(POLL_INTERVAL)


def rotated(path: Path, number: int) -> Path:
    """Return the path of a file after so many rotations."""
    return path.with_name(f"{path.name}.{number}")


def _append(path: Path, data: bytes) -> None:
    """Append to a file that only this user may read; raises OSError."""
    descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        while data:
            data = data[os.write(descriptor, data) :]
    finally:
        os.close(descriptor)
