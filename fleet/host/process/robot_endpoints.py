"""Bus keys of each robot of one process: commands, state, description."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from functools import partial
from typing import cast, get_args

import msgspec

from fleet.bus import keys
from fleet.bus.bus import Bus
from fleet.bus.query_table import QueryTable
from fleet.bus.zenoh_session import Query
from fleet.host.process.permitted_requests import PermittedRequests
from fleet.host.requests.answering import answer_to
from fleet.host.requests.bus_senders import BusSenders
from fleet.host.robot.local_robot import LocalRobot
from fleet.model.command import Reply, ReplyStatus, Transport
from fleet.wire.rules import Kind
from fleet.wire.stops import stop_in

KINDS = get_args(Kind)


class RobotEndpoints:
    """The keys of the robots of one process, ``alone`` if it has all of the edge; on the event loop."""

    def __init__(self, edge: str, bus: Bus, senders: BusSenders, *, alone: bool) -> None:
        self._edge, self._control = edge, bus.control
        self._loop = asyncio.get_running_loop()
        self._senders, self._permitted = senders, PermittedRequests(senders)
        self._tokens: dict[str, Callable[[], None]] = {}  # withdraws the token of each robot
        table = partial(QueryTable[LocalRobot], bus.control, apart=not alone)
        self._tables: Mapping[Callable[[str, str], str], QueryTable[LocalRobot]] = {
            keys.command: table(keys.command(edge, "*"), self._requested, more=keys.SENDER_SUFFIX),
            keys.state: table(keys.state(edge, "*"), self._requested_state),
            keys.description: table(keys.description(edge, "*"), self._requested_description),
        }

    def join(self, robot: LocalRobot) -> None:
        """Serve a robot on the bus."""
        for key, table in self._tables.items():
            table.add(key(self._edge, robot.name), robot)
        self._tokens[robot.name] = self._control.token(keys.robot(self._edge, robot.name))

    def leave(self, robot: LocalRobot) -> None:
        """Stop serving a robot; first its token ends, which shows its presence."""
        if withdraw := self._tokens.pop(robot.name, None):
            withdraw()
        for key, table in self._tables.items():
            table.remove(key(self._edge, robot.name))

    def _requested(self, robot: LocalRobot, question: Query) -> None:
        """Take a query for a robot's commands; on the bus's thread, hence it only hands over."""
        self._loop.call_soon_threadsafe(self._read(robot, question))

    def _requested_state(self, robot: LocalRobot, question: Query) -> None:
        """Answer with the present state, on the event loop; on the bus's thread."""
        self._loop.call_soon_threadsafe(lambda: question.answer(msgspec.json.encode(robot.state())))

    def _requested_description(self, robot: LocalRobot, question: Query) -> None:
        """Answer with the present description, on the event loop; on the bus's thread."""
        self._loop.call_soon_threadsafe(lambda: question.answer(msgspec.json.encode(robot.describe())))

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
        transport = Transport.CLOUD if question.parameters.get("way") == "cloud" else Transport.BUS
        refused = self._permitted.refusal(robot, kind, question, transport)
        if refused is not None:
            return partial(answer, refused)
        request = robot.read(
            kind,
            question.payload,
            transport=transport,
            request_id=question.parameters.get("id", ""),
            waits=waits,
            proven=self._senders.proven(question),
        )
        return question.close if request is None else partial(request, answer)
