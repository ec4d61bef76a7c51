"""Publishes warnings from the robots' logs on their twins' ``driverlog``."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Protocol

from fleet.host.process.robot_process import RobotProcess
from fleet.host.requests.event_reporter import ROBOT_LOGGER
from fleet.model.report import LogReport


class _LoggedRobot(Protocol):
    """A robot whose log lines are published."""

    def publish(self, report: LogReport, /) -> None:
        """Queue a log line for publication."""


class _DriverlogHandler(logging.Handler):
    """Handler that publishes log records about a robot, from level WARNING."""

    def __init__(self, process: RobotProcess, remote: Mapping[str, _LoggedRobot]) -> None:
        super().__init__(logging.WARNING)
        self._process = process
        self._remote = remote

    def emit(self, record: logging.LogRecord) -> None:
        """Pass a record to its robot, on the event loop; from any thread."""
        name = record.name.removeprefix(ROBOT_LOGGER)
        robot = self._process.robots.get(name) or self._remote.get(name)
        if robot is None:
            return
        try:
            report = LogReport(record.created, record.levelname, record.getMessage())
            self._process.loop.call_soon_threadsafe(robot.publish, report)
        except (TypeError, ValueError, RuntimeError):  # bad format arguments; a closed loop
            self.handleError(record)


def publish_robot_logs(
    process: RobotProcess, remote: Mapping[str, _LoggedRobot] = MappingProxyType({})
) -> Callable[[], None]:
    """Publish the robots' warnings on their twins from now on; return a function that ends it.

    ``remote``: robots in workers, about which this process logs warnings too.
    """
    handler = _DriverlogHandler(process, remote)
    logger = logging.getLogger(ROBOT_LOGGER.rstrip("."))
    logger.addHandler(handler)
    return lambda: logger.removeHandler(handler)
