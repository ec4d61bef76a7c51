"""An edge that is a recording: its reports are published on a bus without any robot or other edge."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from pathlib import Path

import msgspec

from fleet.bus import keys
from fleet.bus.bus import open_edge
from fleet.bus.settings import BusSettings
from fleet.bus.zenoh_session import Query, keys_intersect
from fleet.clock import Clock
from fleet.history.event_filter import EventFilter, newest
from fleet.history.record import Record
from fleet.host.robot.report_queue import ReportQueue
from fleet.missions.report import RunState
from fleet.model.command import Reply, ReplyStatus
from fleet.model.report import Report
from fleet.model.state import EdgeState, RobotState
from fleet.record.reading import ReadMessage
from fleet.replay.reports import report_in
from fleet.runtime.decoding import decode_json

log = logging.getLogger(__name__)

PREFIX = "replay-"
"""Prefix of the name of a replayed edge."""
REMEMBERED = 10_000  # events of its history
_REFUSAL = Reply("", ReplyStatus.REJECTED, "this is a recording that is played again: nothing here moves")


class PlayedEdge:
    """One recorded edge on a separate bus below ``directory``; raises BusError.

    The bus listens only on sockets in that directory and connects to nothing. Recorded requests and stops are
    not published; requests to its robots are refused.
    """

    def __init__(self, recorded: str, directory: Path, clock: Clock) -> None:
        self.name = f"{PREFIX}{recorded}"
        self._clock = clock
        self._bus = open_edge(BusSettings(self.name), directory)
        self._outbox = ReportQueue(self._bus.reports)
        self._senders: dict[str, Callable[[Report], None]] = {}  # by robot
        self._last: dict[str, bytes] = {}  # states by key
        self._events: deque[Record] = deque(maxlen=REMEMBERED)
        control = self._bus.control
        for key in (keys.state(self.name, "*"), keys.health(self.name), keys.run(self.name, "*")):
            control.declare_queryable(key, self._answer_last)
        control.declare_queryable(keys.history(self.name), self._answer_history)
        control.declare_queryable(keys.command(self.name, "*"), _refuse)
        self._lives = control.token(keys.edge(self.name))

    def close(self) -> None:
        """Leave the bus."""
        self._bus.close()

    def play(self, message: ReadMessage) -> None:
        """Publish a recorded message, if it is a report, state or event."""
        try:
            self._play(message)
        except (msgspec.DecodeError, ValueError) as error:
            log.warning("%s: %s", message.topic, error)

    def flush(self) -> None:
        """Publish the pending reports."""
        self._outbox.flush()

    def _play(self, message: ReadMessage) -> None:
        """Publish a message; raises ValueError."""
        now = self._clock.time()
        if message.schema == "fleet.RobotState":
            state = decode_json(message.data, RobotState)
            if state.name not in self._senders:
                self._senders[state.name] = self._outbox.sender(state.twin)
            self._publish(keys.state(self.name, state.name), state, edge=self.name, simulated=True, stamp=now)
        elif message.schema == "fleet.EdgeState":
            edge = decode_json(message.data, EdgeState)
            self._publish(keys.health(self.name), edge, edge=self.name, stamp=now)
        elif message.schema == "fleet.RunState":
            run = decode_json(message.data, RunState)
            self._publish(keys.run(self.name, run.run), run, edge=self.name)
        elif message.schema == "fleet.Record":
            event = decode_json(message.data, Record)
            self._events.append(msgspec.structs.replace(event, edge=""))
        else:
            self._report(message, now)

    def _publish(self, key: str, state: msgspec.Struct, **changes: object) -> None:
        """Publish a state, and store it for queries."""
        self._last[key] = payload = msgspec.json.encode(msgspec.structs.replace(state, **changes))
        self._bus.control.put(key, payload)

    def _report(self, message: ReadMessage, now: float) -> None:
        """Publish a report of a robot whose twin is known."""
        send = self._senders.get(message.robot)
        report = report_in(message.schema, message.data) if send is not None else None
        if send is not None and report is not None:
            send(msgspec.structs.replace(report, stamp=now))

    def _answer_last(self, question: Query) -> None:
        """Answer a query with the last states; on the bus's thread."""
        for key, payload in list(self._last.items()):
            if keys_intersect(question.requested, key):
                question.reply(payload, key)
        question.close()

    def _answer_history(self, question: Query) -> None:
        """Answer a query with the replayed events; on the bus's thread."""
        try:
            wanted = decode_json(question.payload, EventFilter) if question.payload else EventFilter()
            question.reply(msgspec.json.encode(newest(list(self._events), wanted)))
        except msgspec.DecodeError as error:
            log.warning("a question for the history was not answered: %s", error)
        question.close()


def _refuse(question: Query) -> None:
    """Refuse a request to a robot; on the bus's thread."""
    question.reply(msgspec.json.encode(_REFUSAL), question.requested)
    question.close()
