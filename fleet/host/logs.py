"""Where log lines go: to stderr for who runs the edge, and a robot's own to its ``driverlog``."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Protocol

from fleet.host.flood import Flood
from fleet.host.process import RobotProcess
from fleet.host.teller import ROBOT_LOGGER
from fleet.model.report import LogReport


class _Robot(Protocol):
    """A robot whose log lines are published."""

    def publish(self, report: LogReport, /) -> None:
        """Send a line on its way."""


class _ToDriverlog(logging.Handler):
    """Publishes what is logged about a robot, warnings and worse."""

    def __init__(self, process: RobotProcess, remote: Mapping[str, _Robot]) -> None:
        super().__init__(logging.WARNING)
        self._process = process
        self._remote = remote

    def emit(self, record: logging.LogRecord) -> None:
        """Hand a line to its robot, on the loop; from any thread."""
        name = record.name.removeprefix(ROBOT_LOGGER)
        robot = self._process.robots.get(name) or self._remote.get(name)
        if robot is None:
            return
        try:
            report = LogReport(record.created, record.levelname, record.getMessage())
            self._process.loop.call_soon_threadsafe(robot.publish, report)
        except (TypeError, ValueError, RuntimeError):  # a line that cannot be put together; a closed loop
            self.handleError(record)


def publish_robot_logs(
    process: RobotProcess, remote: Mapping[str, _Robot] = MappingProxyType({})
) -> Callable[[], None]:
    """Send the robots' warnings to their twins from now on; returns what ends it.

    ``remote``: robots in workers, of which this process warns too.
    """
    handler = _ToDriverlog(process, remote)
    logger = logging.getLogger(ROBOT_LOGGER.rstrip("."))
    logger.addHandler(handler)
    return lambda: logger.removeHandler(handler)


class _ToStderr(logging.Handler):
    """Writes to whatever stderr is at the time: a live table on the terminal replaces it."""

    def __init__(self) -> None:
        super().__init__()
        self._flood = Flood()

    def emit(self, record: logging.LogRecord) -> None:
        """Write one line, unless there were too many like it."""
        more = self._flood.admit((record.name, str(record.msg)), record.created)
        if more is None:
            return
        told = f" ({more} more like this before)" if more else ""
        try:
            sys.stderr.write(f"{self.format(record)}{told}\n")
        except (OSError, ValueError):
            self.handleError(record)


def log_to_stderr(level: int) -> None:
    """Log one line each to stderr: time, level, where, what."""
    handler = _ToStderr()
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)-7s %(name)s: %(message)s", "%H:%M:%S"))
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level)
