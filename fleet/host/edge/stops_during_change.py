"""Emergency stops requested during a change, which must also reach the robots that it adds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fleet.host.process.robot_process import RobotProcess
from fleet.host.requests.stop_cause import StopCause
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.workers.remote_robot import RemoteRobot


class StopsDuringChange:
    """Stops of one process from ``begin`` to ``end``."""

    def __init__(self, process: RobotProcess) -> None:
        self._stops: list[tuple[tuple[str, ...], StopCause]] = []
        self._groups: Mapping[str, Iterable[str]] = {}
        self._under_way = False
        process.stop_requested = self._requested

    def begin(self, groups: Mapping[str, Iterable[str]]) -> None:
        """Start recording; ``groups`` are those that robots will have."""
        self._stops, self._groups, self._under_way = [], groups, True

    def end(self) -> None:
        """Stop recording."""
        self._stops, self._under_way = [], False

    def engage(self, robot: LocalRobot) -> None:
        """Set the recorded stops of a robot."""
        for cause in self._of(robot.name):
            robot.controller.latch.engage(cause.sentence)
        robot.controller.latch.record()

    def pass_on(self, robot: RemoteRobot) -> None:
        """Pass the recorded stops to a robot in a worker that has not run it until now."""
        for cause in self._of(robot.name):
            robot.stop_later(cause)

    def _of(self, name: str) -> list[StopCause]:
        """Return the stops that name a robot, or a group of it, or no robot at all."""
        known = {name, *(group for group, members in self._groups.items() if name in members)}
        return [cause for named, cause in list(self._stops) if not named or known.intersection(named)]

    def _requested(self, names: tuple[str, ...], cause: StopCause) -> None:
        """Record a stop before robots are looked up, so that one added later gets it; from any thread."""
        if self._under_way:
            self._stops.append((names, cause))
