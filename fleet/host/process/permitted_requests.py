"""Requests for persons to the robots of a process: their permission is checked here, by the edge.

A console has checked that of its person before. But its process, and whoever has its certificate, are not
this edge.
"""

from __future__ import annotations

from fleet.bus.zenoh_session import Query
from fleet.errors import WireError
from fleet.host.requests.askers import Askers
from fleet.host.requests.decode import Ask, is_stop
from fleet.host.robot.local_robot import LocalRobot
from fleet.model.command import Command, Reply, ReplyStatus, Transport
from fleet.model.permission import Permission, needed_for_command
from fleet.wire.rules import Kind


class PermittedRequests:
    """Judges requests to robots by who asks."""

    def __init__(self, askers: Askers) -> None:
        self._askers = askers

    def refusal(self, robot: LocalRobot, kind: Kind, question: Query, way: Transport) -> Reply | None:
        """Return the answer to a request that is refused; None for one that may go on, as a program's may.

        ``way``: as it will be read. A stop needs no permission. What cannot be read here is refused to who
        may not operate: the robot reads it once more, and may know more by then.
        """
        if not question.suffix:
            return None
        try:
            ask = robot.requests.ask_of(kind, question.payload, way=way, request_id="")
        except WireError as error:
            if not self._refused(robot, question, Permission.OPERATE, kind):
                return None
            return Reply(kind, ReplyStatus.REJECTED, str(error))
        if ask is None or is_stop(ask):
            return None
        why = self.refusal_of(robot, question, ask)
        return Reply(ask.name, ReplyStatus.REJECTED, why) if why else None

    def refusal_of(self, robot: LocalRobot, question: Query, ask: Ask) -> str:
        """Return why somebody may not ask this of a robot; empty when he may, and for programs."""
        return self._refused(robot, question, _needed(ask), ask.name, ask.origin.session)

    def _refused(
        self, robot: LocalRobot, question: Query, needed: Permission, what: str, claimed: str = ""
    ) -> str:
        """Return why what needs a permission is refused."""
        return self._askers.refusal(question, needed, what, claimed=claimed, robot=robot.name)


def _needed(ask: Ask) -> Permission:
    """Return the permission that a request to a robot needs."""
    return needed_for_command(ask.name) if isinstance(ask, Command) else Permission.OPERATE
