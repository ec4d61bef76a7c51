"""Emergency stops that are asked for during a change: they reach the robots that it brings, too."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fleet.host.process.robot_process import RobotProcess
from fleet.host.requests.stop_cause import StopCause
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.workers.remote_robot import RemoteRobot


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
        for cause in self._of(robot.name, *names):
            robot.controller.latch.engage(cause.why)
        robot.controller.latch.record()

    def pass_on(self, robot: RemoteRobot, *names: str) -> None:
        """Have a robot in a worker stopped that was asked to stop before its worker ran it."""
        for cause in self._of(robot.name, *names):
            robot.stop_later(cause)

    def _of(self, *names: str) -> list[StopCause]:
        """Return the stops that name a robot, or a group of it, or nobody."""
        known = set(names)
        known |= {group for group, members in self._groups.items() if known.intersection(members)}
        return [cause for named, cause in list(self._stops) if not named or known.intersection(named)]

    def _stopped(self, names: tuple[str, ...], cause: StopCause) -> None:
        """Remember a stop; from any thread."""
        self._stops.append((names, cause))
        self._tell(names, cause)
