"""Publishes warnings about a robot, as the process logs them, to the twin's ``driverlog``."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Protocol

from fleet.host.process.robot_process import RobotProcess
from fleet.host.requests.event_reporter import ROBOT_LOGGER
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
