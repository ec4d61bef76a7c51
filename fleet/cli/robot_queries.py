"""Queries to robots, for commands that show the answers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import msgspec

from fleet.client.edges import Edges
from fleet.client.local_user import stamped
from fleet.errors import FleetError, Refused, TimedOut
from fleet.model.command import Reply, ReplyStatus
from fleet.model.state import RobotState


class QueryResult(msgspec.Struct, frozen=True):
    """Answer of one robot: ``data``, or the ``error``."""

    robot: RobotState
    data: Any = None
    error: FleetError | None = None

    def get(self) -> object:
        """Return the data; raises the error."""
        if self.error is not None:
            raise self.error
        return self.data


class RobotQuery:
    """Queries to one robot; raises UnknownRobot, and Refused for a group."""

    def __init__(self, edges: Edges, name: str) -> None:
        found = edges.named(name)
        if len(found) > 1:
            raise Refused(f"{name} is a group", hint="name one robot")
        self.robot: RobotState = found[0]
        self._edges = edges

    def request(self, command: str, data: dict[str, Any] | None = None, *, timeout: float) -> object:
        """Return the robot's answer to a command; raises TimedOut, or Refused with its reason."""
        (answered,) = query_all(self._edges, [self.robot], command, data, timeout=timeout)
        return answered.get()


def query_all(
    edges: Edges,
    robots: Iterable[RobotState],
    command: str,
    data: dict[str, object] | None = None,
    *,
    timeout: float,
) -> list[QueryResult]:
    """Query several robots concurrently; return the answer of each."""
    payload = stamped({"command": command, "data": data or {}})  # stamped when it is sent
    requested = [
        (robot, edges.command(robot, payload, kind="command", wait=True, timeout=timeout)) for robot in robots
    ]
    return [_answered(robot, command, replies, timeout) for robot, replies in requested]


def _answered(robot: RobotState, command: str, replies: Iterator[Reply], timeout: float) -> QueryResult:
    """Wait for a robot's last reply; convert it to a result."""
    last: Reply | None = None
    for last in replies:
        if last.done is not None or not last.ok:
            break
    if last is None or (last.ok and last.done is None) or last.status is ReplyStatus.TIMEOUT:
        reason = last.reason if last is not None and last.reason else f"no answer within {timeout:g} s"
        return QueryResult(robot, error=TimedOut(f"{robot.name}: {command}: {reason}"))
    if not last.ok or not last.done:
        return QueryResult(robot, error=Refused(f"{robot.name}: {command}: {last.reason}", hint=last.hint))
    return QueryResult(robot, last.data)
