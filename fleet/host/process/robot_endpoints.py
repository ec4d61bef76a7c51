"""Bus keys of each robot of one process: commands, state, description."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from functools import partial
from typing import cast, get_args

import msgspec

from fleet.bus import keys
from fleet.bus.bus import Bus
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
    """The keys of the robots of one process; on the event loop."""

    def __init__(self, edge: str, bus: Bus, askers: Askers) -> None:
        self._edge, self._control = edge, bus.control
        self._loop = asyncio.get_running_loop()
        self._askers, self._permitted = askers, PermittedRequests(askers)

    def open(self, robot: LocalRobot) -> Callable[[], None]:
        """Serve a robot on the bus; return a function that ends it."""
        edge, control, opened = self._edge, self._control, contextlib.ExitStack()
        for end in (
            control.answer(keys.command(edge, robot.name), self._asker(robot), more=keys.ASKER),
            control.answer(keys.state(edge, robot.name), self._teller(robot.state)),
            control.answer(keys.description(edge, robot.name), self._teller(robot.describe)),
            control.token(keys.robot(edge, robot.name)),  # ends first: it shows that the robot is there
        ):
            opened.callback(end)
        return opened.close

    def _asker(self, robot: LocalRobot) -> Callable[[Query], None]:
        """Return the query handler for a robot's commands; on the bus's thread, hence it only hands over."""

        def asked(question: Query) -> None:
            self._loop.call_soon_threadsafe(self._read(robot, question))

        return asked

    def _teller(self, what: Callable[[], msgspec.Struct]) -> Callable[[Query], None]:
        """Return a query handler that answers with the present value, on the event loop."""

        def tell(question: Query) -> None:
            question.reply(msgspec.json.encode(what()))
            question.close()

        def asked(question: Query) -> None:
            self._loop.call_soon_threadsafe(tell, question)

        return asked

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
