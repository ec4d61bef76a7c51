"""Format of log lines: text with date and zone for people, one JSON object per line for programs."""

from __future__ import annotations

import logging
from datetime import UTC, datetime
from typing import Literal

import msgspec

from fleet.config.text import printable
from fleet.host.requests.event_reporter import ROBOT_LOGGER
from fleet.runtime.event_loop import OWNER

Format = Literal["text", "json"]
FORMAT = 1  # format number of the lines in the log file
LONGEST = 8192  # characters of a line's message, and of a traceback


class LogLine(msgspec.Struct, frozen=True, omit_defaults=True):
    """One line of the log; ``time`` is ISO 8601 with date and zone, ``stamp`` the same in Unix seconds.

    ``robot`` is the robot that it is about, empty for none. ``format`` is left out while it is 1.
    """

    time: str
    stamp: float
    level: str
    logger: str
    message: str
    robot: str = ""
    error: str = ""
    format: int = FORMAT


class TextFormatter(logging.Formatter):
    """``2026-11-22T19:33:40.123+01:00 WARNING fleet.robot.rex: message``; a traceback follows."""

    def formatTime(self, record: logging.LogRecord, datefmt: str | None = None) -> str:  # noqa: ARG002, N802
        """Return date, time and zone."""
        return local_time(record.created)

    def __init__(self) -> None:
        super().__init__("%(asctime)s %(levelname)-7s %(name)s: %(message)s")


class JsonFormatter(logging.Formatter):
    """A ``LogLine`` as JSON."""

    def format(self, record: logging.LogRecord) -> str:
        """Return one line."""
        return msgspec.json.encode(line_of(record, self)).decode()


def line_of(record: logging.LogRecord, formatter: logging.Formatter) -> LogLine:
    """Return a record as a line."""
    name = record.name
    robot = name.removeprefix(ROBOT_LOGGER) if name.startswith(ROBOT_LOGGER) else OWNER.get()
    error = formatter.formatException(record.exc_info) if record.exc_info else ""
    return LogLine(
        local_time(record.created),
        round(record.created, 3),
        record.levelname,
        name,
        _clean(record.getMessage()),
        robot,
        _clean(error),
    )


def formatter_of(form: Format) -> logging.Formatter:
    """Return the formatter for a format."""
    return JsonFormatter() if form == "json" else TextFormatter()


def as_text(line: LogLine) -> str:
    """Return a line as text, safe for a terminal; a traceback follows on separate lines."""
    text = printable(f"{line.time} {line.level:<7} {line.logger}: {line.message}")
    return "\n".join([text, *(f"    {printable(each)}" for each in line.error.splitlines())])


def local_time(stamp: float) -> str:
    """Return Unix seconds as date, time and zone of this computer."""
    return datetime.fromtimestamp(stamp, UTC).astimezone().isoformat(timespec="milliseconds")


def _clean(text: str) -> str:
    """Return text shortened and encodable."""
    return text[:LONGEST].encode(errors="backslashreplace").decode()
