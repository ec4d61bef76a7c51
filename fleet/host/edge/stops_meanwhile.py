"""Emergency stops that are asked for during a change: they reach the robots that it brings, too."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fleet.host.process.robot_process import RobotProcess
from fleet.host.requests.stop_cause import StopCause
from fleet.host.robot.local_robot import LocalRobot


class StopsMeanwhile:
    """The stops of one process since ``begin``."""

    def __init__(self, process: RobotProcess) -> None:
        self._stops: list[tuple[tuple[str, ...], StopCause]] = []
        self._groups: Mapping[str, Iterable[str]] = {}
        self._tell, process.on_stop = process.on_stop, self._stopped

    def begin(self, groups: Mapping[str, Iterable[str]]) -> None:
        """Begin to remember; ``groups`` are those that robots will have."""
        self._stops, self._groups = [], groups

    def engage(self, robot: LocalRobot, *names: str) -> None:
        """Set the stops that were asked for of a robot, under its own name or one of these."""
        known = {robot.name, *names}
        known |= {group for group, members in self._groups.items() if known.intersection(members)}
        for named, cause in list(self._stops):
            if not named or known.intersection(named):
                robot.controller.latch.engage(cause.why)
        robot.controller.latch.record()

    def _stopped(self, names: tuple[str, ...], cause: StopCause) -> None:
        """Remember a stop; from any thread."""
        self._stops.append((names, cause))
        self._tell(names, cause)
