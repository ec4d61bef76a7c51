"""Bus keys of each robot of one process: commands, state, description."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from functools import partial
from typing import cast, get_args

import msgspec

from fleet.bus import keys
from fleet.bus.bus import Bus
from fleet.bus.query_table import QueryTable
from fleet.bus.zenoh_session import Query
from fleet.host.process.permitted_requests import PermittedRequests
from fleet.host.requests.answering import answer_to
from fleet.host.requests.askers import Askers
from fleet.host.robot.local_robot import LocalRobot
from fleet.model.command import Reply, ReplyStatus, Transport
from fleet.wire.rules import Kind
from fleet.wire.stops import stop_in

KINDS = get_args(Kind)


class RobotEndpoints:
    """The keys of the robots of one process, the edge's or a ``worker``'s; on the event loop."""

    def __init__(self, edge: str, bus: Bus, askers: Askers, worker: str) -> None:
        self._edge, self._control = edge, bus.control
        self._loop = asyncio.get_running_loop()
        self._askers, self._permitted = askers, PermittedRequests(askers)
        table = partial(QueryTable, bus.control, apart=bool(worker))
        self._commands = table(keys.command(edge, "*"), more=keys.ASKER)
        self._states, self._descriptions = table(keys.state(edge, "*")), table(keys.description(edge, "*"))

    def open(self, robot: LocalRobot) -> Iterable[Callable[[], None]]:
        """Serve a robot on the bus; return functions that end it, to be called in reverse."""
        edge, name = self._edge, robot.name
        return (
            self._commands.add(keys.command(edge, name), partial(self._asked, robot)),
            self._states.add(keys.state(edge, name), partial(self._tell, robot.state)),
            self._descriptions.add(keys.description(edge, name), partial(self._tell, robot.describe)),
            self._control.token(keys.robot(edge, name)),  # ends first: it shows that the robot is there
        )

    def _asked(self, robot: LocalRobot, question: Query) -> None:
        """Take a query for a robot's commands; on the bus's thread, hence it only hands over."""
        self._loop.call_soon_threadsafe(self._read(robot, question))

    def _tell(self, what: Callable[[], msgspec.Struct], question: Query) -> None:
        """Answer with the present value, on the event loop; on the bus's thread."""
        self._loop.call_soon_threadsafe(lambda: question.answer(msgspec.json.encode(what())))

    def _read(self, robot: LocalRobot, question: Query) -> Callable[[], None]:
        """Decode a robot's query, on the bus's thread; return the call that executes it, on the loop.

        Its replies are the receipt and, if the sender waits, the final result.
        """
        waits = question.parameters.get("wait") == "1"
        kind = cast("Kind", question.parameters.get("kind", "command"))

        answer = answer_to(question, waits=waits)
        if kind not in KINDS and stop_in(question.payload):
            kind = "command"
        if kind not in KINDS:
            refusal = f"{kind!r} is no kind of message; one of {', '.join(KINDS)}"
            return partial(answer, Reply(kind, ReplyStatus.REJECTED, refusal))
        way = Transport.CLOUD if question.parameters.get("way") == "cloud" else Transport.BUS
        refused = self._permitted.refusal(robot, kind, question, way)
        if refused is not None:
            return partial(answer, refused)
        take = robot.read(
            kind,
            question.payload,
            way=way,
            request_id=question.parameters.get("id", ""),
            waits=waits,
            proven=self._askers.proven(question),
        )
        return question.close if take is None else partial(take, answer)
