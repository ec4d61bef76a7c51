"""Emergency stops of robots renamed since the edge last ran: only a release ends a stop."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path

from fleet.config.difference import outline_of, renamed
from fleet.config.load import Loaded
from fleet.errors import StateError
from fleet.host.edge.last_configuration import last_configuration
from fleet.host.process.robot_process import RobotProcess
from fleet.host.requests.stop_cause import local_cause
from fleet.host.workers.remote_robot import RemoteRobot

log = logging.getLogger(__name__)


def carry_stops(
    loaded: Loaded, folder: Path, process: RobotProcess, remote: Mapping[str, RemoteRobot]
) -> None:
    """Set the stops of renamed robots, found by their twins in the last configuration of the edge."""
    try:
        last = last_configuration(folder)
    except StateError as error:
        log.warning("robots with another name since the last run are not known: %s", error)
        return
    names = renamed(last.outline, outline_of(loaded)) if last is not None else {}
    for name, before in names.items():
        why = process.journal.robot(before).latched
        if not why:
            continue
        log.warning("%s was %s: its emergency stop is still set: %s", name, before, why)
        if name in remote:
            process.journal.robot(name).latch(why)  # the edge may end before the worker receives it
            remote[name].stop_later(local_cause("", why))
        else:
            latch = process.robots[name].controller.latch
            latch.engage(why)
            latch.record()
