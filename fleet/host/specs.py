"""Which robots of a fleet file run in which process."""

from __future__ import annotations

from fleet.config.load import Loaded
from fleet.host.process import RobotSpec
from fleet.host.settings import worker_of


def specs_of(loaded: Loaded, worker: str = "") -> list[RobotSpec]:
    """Return the robots of a worker, without a name those of the edge's own process."""
    return [
        RobotSpec(robot, plugin.adapter, plugin.name)
        for robot, plugin in loaded.robots
        if worker_of(robot, plugin) == worker
    ]
