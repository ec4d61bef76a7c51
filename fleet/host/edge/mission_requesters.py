"""Senders of requests for missions and runs: checks their permissions, and whether their names are proven."""

from __future__ import annotations

from collections import deque

import msgspec

from fleet.bus.zenoh_session import Query
from fleet.errors import Refused
from fleet.host.requests.bus_senders import BusSenders
from fleet.missions.report import MissionStartRequest, RunControlRequest, RunState
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

    def start(self, question: Query) -> MissionStartRequest:
        """Return a request to start a mission from a permitted sender; raises Refused, DecodeError."""
        if "*" in question.requested:
            raise Refused("a mission is started on one edge", hint="name the edge and the mission")
        if len(question.payload) > LARGEST:
            raise Refused(f"the mission is larger than {LARGEST >> 20} MiB")
        request = decode_json(question.payload, MissionStartRequest)
        if request.run:
            check_run_id(request.run)
        needed = Permission.OPERATE if request.mission is None else Permission.ADMIN
        what = f"mission {question.requested.rpartition('/')[2]}: {question.parameters.get('do')}"
        if refusal := self._senders.refusal(question, needed, what, claimed=request.session_id):
            raise Refused(refusal)
        proven = self._senders.proven(question)
        if proven is None:
            return request
        request = msgspec.structs.replace(request, session_id=proven or request.session_id)
        if request.run:
            self._started.append((request.run, request.session_id))
        return request

    def control(self, question: Query, run: str, request: RunControlRequest) -> RunControlRequest:
        """Return a request to control a run from a permitted sender; raises Refused."""
        what = f"run {run}: {request.do}"
        if refusal := self._senders.refusal(question, Permission.OPERATE, what, claimed=request.session_id):
            raise Refused(refusal)
        return msgspec.structs.replace(
            request, session_id=self._senders.proven(question) or request.session_id
        )

    def starter(self, state: RunState) -> Requester:
        """Return the starter of a run, for the history."""
        proven = state.transport == Transport.MISSION or (state.run, state.by) in self._started
        return Requester(Transport(state.transport), state.by, proven=proven)
