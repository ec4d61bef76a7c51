"""Requests from consoles to the robots of a process: the permission is checked here again, by the edge.

The console has checked it before. But its process, and whoever has its certificate, are not this edge.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Collection

from fleet.bus.zenoh_session import Query
from fleet.clock import Clock
from fleet.errors import Refused, WireError
from fleet.host.requests.console_asker import console_asker, console_refusal
from fleet.host.requests.decode import Ask, is_stop
from fleet.host.robot.local_robot import LocalRobot
from fleet.model.command import Command, Reply, ReplyStatus, Transport
from fleet.model.permission import Permission, needed_for_command
from fleet.runtime.rate_limited_counter import RateLimitedCounter
from fleet.wire.rules import Kind

log = logging.getLogger(__name__)


class ConsoleRequests:
    """Judges requests of consoles; ``proven`` are those whose certificates the bus checks by name."""

    def __init__(self, proven: Collection[str], clock: Clock) -> None:
        self._proven = proven
        self._refused = RateLimitedCounter(log, clock)

    def refusal(self, robot: LocalRobot, kind: Kind, question: Query, way: Transport) -> Reply | None:
        """Return the answer to a request that is refused; None for one that may go on, as a program's may.

        ``way``: as it will be read. A stop needs no permission. What cannot be read here is refused to who
        may not operate: the robot reads it once more, and may know more by then.
        """
        if not question.suffix:
            return None
        ask: Ask | None = None
        try:
            ask = robot.requests.ask_of(kind, question.payload, way=way, request_id="")
            if ask is None or is_stop(ask):
                return None
            why = console_refusal(question, _needed(ask))
        except WireError as error:
            why = str(error) if console_refusal(question, Permission.OPERATE) else ""
        if not why:
            return None
        self._refused.add(robot.name, "refused a request of a console to %s: %s", robot.name, why)
        return Reply(ask.name if ask else kind, ReplyStatus.REJECTED, why)

    def is_proven(self, question: Query) -> bool:
        """Return whether the name of the person who asks is known to be true: a known console tells it."""
        with contextlib.suppress(Refused):  # of a malformed key; a stop that comes by one is a stop
            asker = console_asker(question)
            return asker is not None and asker.console in self._proven
        return False


def _needed(ask: Ask) -> Permission:
    """Return the permission that a request to a robot needs."""
    return needed_for_command(ask.name) if isinstance(ask, Command) else Permission.OPERATE
