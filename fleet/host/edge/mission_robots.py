"""The robots of an edge as runs of missions need them, here and in workers, and what they can."""

from __future__ import annotations

from fleet.host.robot.local_robot import LocalRobot
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.model.command import Request, Transport
from fleet.model.description import RobotDescription
from fleet.model.state import RobotState
from fleet.wire.rules import Kind


class RobotHere:
    """A robot of this process, as a run needs it."""

    def __init__(self, robot: LocalRobot) -> None:
        self._robot = robot
        self.name = robot.name
        self.state = robot.state
        self.describe = robot.describe

    def read(
        self, kind: Kind, payload: bytes, *, way: Transport, request_id: str = "", waits: bool = False
    ) -> Request | None:
        """Read a message; what is returned takes it."""
        return self._robot.read(kind, payload, way=way, request_id=request_id, waits=waits)


class RobotElsewhere:
    """A robot in a worker; what it takes is told by its worker."""

    def __init__(self, robot: RemoteRobot) -> None:
        self._robot = robot
        self.name = robot.name
        self.state = robot.state

    def read(
        self, kind: Kind, payload: bytes, *, way: Transport, request_id: str = "", waits: bool = False
    ) -> Request | None:
        """Read a message; what is returned takes it."""
        return self._robot.read(kind, payload, way=way, request_id=request_id, waits=waits)


def can(description: RobotDescription | None) -> frozenset[str]:
    """Return what a robot takes."""
    if description is None:
        return frozenset()
    more = {"goto": description.goals, "path": description.goals, "plan": description.missions}
    names = {command.name for command in description.commands}
    return frozenset(names | {name for name, takes in more.items() if takes})


def trouble(state: RobotState, description: RobotDescription | None) -> str:
    """Return why a robot cannot take part in anything now."""
    if not state.reachable:
        return f"it is offline: {state.cause}"
    if state.emergency_stop:
        return f"its emergency stop is set: {state.stop_cause}"
    return "" if description is not None else "its worker does not say what it takes"
