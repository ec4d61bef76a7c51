"""Permissions for requests of persons to the robots of a process, checked by the edge itself.

A console has checked its user's permission before, but its process, and any holder of its certificate, are
outside this edge.
"""

from __future__ import annotations

from fleet.bus.zenoh_session import Query
from fleet.errors import WireError
from fleet.host.requests.bus_senders import BusSenders
from fleet.host.requests.decode import RobotRequest, is_stop
from fleet.host.robot.local_robot import LocalRobot
from fleet.model.command import Command, Reply, ReplyStatus, Transport
from fleet.model.permission import Permission, needed_for_command
from fleet.wire.rules import Kind


class PermittedRequests:
    """Judges requests to robots by their sender's permission."""

    def __init__(self, senders: BusSenders) -> None:
        self._senders = senders

    def refusal(self, robot: LocalRobot, kind: Kind, question: Query, transport: Transport) -> Reply | None:
        """Return the reply to a request that is refused; None for one that may go on.

        It will be decoded with this ``transport``. A stop needs no permission. A message that cannot be
        decoded here is refused to users who may not operate; for others the robot decodes it again, and may
        know more by then.
        """
        if not question.suffix:
            return None
        try:
            request = robot.requests.decode_request(
                kind, question.payload, transport=transport, request_id=""
            )
        except WireError as error:
            if not self._refused(robot, question, Permission.OPERATE, kind):
                return None
            return Reply(kind, ReplyStatus.REJECTED, str(error))
        if request is None or is_stop(request):
            return None
        why = self.refusal_of(robot, question, request)
        return Reply(request.name, ReplyStatus.REJECTED, why) if why else None

    def refusal_of(self, robot: LocalRobot, question: Query, request: RobotRequest) -> str:
        """Return why the sender may not ask this of a robot; empty when it may, and for programs."""
        return self._refused(robot, question, _needed(request), request.name, request.origin.session)

    def _refused(
        self, robot: LocalRobot, question: Query, needed: Permission, what: str, claimed: str = ""
    ) -> str:
        """Return the refusal of a request that needs a permission; empty when permitted."""
        return self._senders.refusal(question, needed, what, claimed=claimed, robot=robot.name)


def _needed(request: RobotRequest) -> Permission:
    """Return the permission that a request to a robot needs."""
    return needed_for_command(request.name) if isinstance(request, Command) else Permission.OPERATE
