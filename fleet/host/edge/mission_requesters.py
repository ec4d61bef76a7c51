"""Senders of requests for missions and runs: checks their permissions, and whether their names are proven."""

from __future__ import annotations

from collections import deque

import msgspec

from fleet.bus.zenoh_session import Query
from fleet.errors import Refused
from fleet.host.requests.bus_senders import BusSenders
from fleet.missions.report import ControlAsk, RunState, StartAsk
from fleet.missions.runs import check_run_id
from fleet.model.command import Transport
from fleet.model.event import Requester
from fleet.model.permission import Permission
from fleet.runtime.decoding import decode_json

LARGEST = 1 << 20  # bytes of the largest mission in a request
KNOWN = 100  # runs whose proven starters are remembered


class MissionRequesters:
    """Decodes requests for the missions of one edge, with permissions; from any thread."""

    def __init__(self, senders: BusSenders) -> None:
        self._senders = senders
        self._started: deque[tuple[str, str]] = deque(maxlen=KNOWN)  # (run, proven starter)

    def start(self, question: Query) -> StartAsk:
        """Return a request to start a mission from a permitted sender; raises Refused, DecodeError."""
        if "*" in question.asked:
            raise Refused("a mission is started on one edge", hint="name the edge and the mission")
        if len(question.payload) > LARGEST:
            raise Refused(f"the mission is larger than {LARGEST >> 20} MiB")
        ask = decode_json(question.payload, StartAsk)
        if ask.run:
            check_run_id(ask.run)
        needed = Permission.OPERATE if ask.mission is None else Permission.ADMIN
        what = f"mission {question.asked.rpartition('/')[2]}: {question.parameters.get('do')}"
        if refusal := self._senders.refusal(question, needed, what, claimed=ask.session_id):
            raise Refused(refusal)
        proven = self._senders.proven(question)
        if proven is None:
            return ask
        ask = msgspec.structs.replace(ask, session_id=proven or ask.session_id)
        if ask.run:
            self._started.append((ask.run, ask.session_id))
        return ask

    def control(self, question: Query, run: str, ask: ControlAsk) -> ControlAsk:
        """Return a request to control a run from a permitted sender; raises Refused."""
        what = f"run {run}: {ask.do}"
        if refusal := self._senders.refusal(question, Permission.OPERATE, what, claimed=ask.session_id):
            raise Refused(refusal)
        return msgspec.structs.replace(ask, session_id=self._senders.proven(question) or ask.session_id)

    def starter(self, state: RunState) -> Requester:
        """Return the starter of a run, for the history."""
        proven = state.transport == Transport.MISSION or (state.run, state.by) in self._started
        return Requester(Transport(state.transport), state.by, proven=proven)
