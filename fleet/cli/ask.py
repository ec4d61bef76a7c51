"""Asking one robot for something, for the commands that show what it answers."""

from __future__ import annotations

from typing import Any

from fleet.cli.connect import Edges
from fleet.cli.send import stamped
from fleet.errors import Refused, TimedOut
from fleet.model.command import Reply, ReplyStatus
from fleet.model.state import RobotState


class Asker:
    """One robot that is asked; raises UnknownRobot, and Refused for a group."""

    def __init__(self, edges: Edges, name: str) -> None:
        found = edges.named(name)
        if len(found) > 1:
            raise Refused(f"{name} is a group", hint="name one robot")
        self.robot: RobotState = found[0]
        self._edges = edges

    def ask(self, command: str, data: dict[str, Any] | None = None, *, timeout: float) -> Any:
        """Return what the robot answers to a command; raises TimedOut, or Refused in its own words."""
        payload = stamped({"command": command, "data": data or {}})
        last: Reply | None = None
        for last in self._edges.command(self.robot, payload, kind="command", wait=True, timeout=timeout):
            if last.done is not None or not last.ok:
                break
        if last is None or (last.ok and last.done is None) or last.status is ReplyStatus.TIMEOUT:
            reason = last.reason if last is not None and last.reason else f"no answer within {timeout:g} s"
            raise TimedOut(f"{self.robot.name}: {command}: {reason}")
        if not last.ok or not last.done:
            raise Refused(f"{self.robot.name}: {command}: {last.reason}", hint=last.hint)
        return last.data
