"""Log output of a process: stderr, an optional file, and the file of ``fleet logs``."""

from __future__ import annotations

import contextlib
import logging
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import msgspec

from fleet.host.logs.flood_filter import FloodFilter
from fleet.host.logs.line_format import Format, JsonFormatter, formatter_of
from fleet.host.logs.rotating_file import RotatingLogFile
from fleet.host.logs.systemd_journal import STREAM, JournalHandler, is_journal

FORM, FILE = "FLEET_LOG_FORMAT", "FLEET_LOG_FILE"
PASSED_VARIABLES = (FORM, FILE, STREAM)
"""Environment variables with the log settings for workers."""


class _StderrHandler(logging.Handler):
    """Writes to the present stderr: a live table on the terminal replaces it."""

    def __init__(self, level: int) -> None:
        super().__init__(level)
        self._flood = FloodFilter()

    def emit(self, record: logging.LogRecord) -> None:
        """Write one line, unless there were too many like it."""
        more = self._flood.admit((record.name, str(record.msg)), record.created)
        if more is None:
            return
        omitted = f" ({more} more like this before)" if more else ""
        try:
            sys.stderr.write(f"{self.format(record)}{omitted}\n")
        except (OSError, ValueError):
            self.handleError(record)


class LogSettings(msgspec.Struct, frozen=True):
    """Settings of the log: lowest ``level`` on stderr, format, and file.

    Workers get format and file by environment variables; each writes to a file of its own.
    """

    level: int = logging.WARNING
    form: Format = "text"
    file: Path | None = None

    def export(self) -> None:
        """Set the environment variables for workers started from here."""
        os.environ[FORM] = self.form
        if self.file is not None:
            os.environ[FILE] = str(self.file.absolute())

    @classmethod
    def of_a_worker(cls, name: str, environ: Mapping[str, str] = os.environ) -> LogSettings:
        """Return the log settings of a worker, from its environment."""
        given = environ.get(FILE)
        path = Path(given) if given else None
        own = path.with_name(f"{path.stem}.{name}{path.suffix}") if path else None
        return cls(logging.INFO, "json" if environ.get(FORM) == "json" else "text", own)


def _stderr(level: int) -> logging.Handler:
    """Return the handler for people: stderr, or the journal if systemd connects stderr to it."""
    with contextlib.suppress(OSError, ValueError):  # a stderr without a descriptor is not the journal
        if is_journal(sys.stderr.fileno()):
            return JournalHandler(min(level, logging.INFO), "fleet")
    return _StderrHandler(level)


def start_logging(wanted: LogSettings, kept: Path | None = None) -> Callable[[], None]:
    """Log to stderr, the configured file, and ``kept`` for ``fleet logs``; return a function that ends it.

    Where stderr goes to the journal of systemd, lines are sent there with their fields instead.
    """
    stderr = _stderr(wanted.level)
    stderr.setFormatter(formatter_of(wanted.form))
    files = [RotatingLogFile(wanted.file, formatter_of(wanted.form))] if wanted.file else []
    files += [RotatingLogFile(kept, JsonFormatter())] if kept else []
    for file in files:
        file.setLevel(min(wanted.level, logging.INFO))
    root = logging.getLogger()
    root.handlers[:] = [stderr, *files]
    root.setLevel(min(handler.level for handler in root.handlers))

    def end() -> None:
        for file in files:
            root.removeHandler(file)
            file.close()

    return end
