"""Queries on the bus of an edge's missions and runs: they show, start, rehearse and control them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import Query, ZenohSession
from fleet.config.missions import Mission
from fleet.errors import Refused
from fleet.host.edge.known_missions import KnownMissions
from fleet.host.edge.mission_requesters import MissionRequesters
from fleet.host.edge.rehearsals import Rehearsals
from fleet.host.edge.run_results import RunResults
from fleet.host.edge.start_requests import StartRequests
from fleet.missions.filling import mission_state
from fleet.missions.report import Controlled, MissionStartRequest, RunControlRequest, Started, ended_state
from fleet.missions.runs import Runs
from fleet.missions.state import RunHead, RunMember
from fleet.missions.store import RunLogEntry, RunOrigin, RunStore
from fleet.model.command import Transport
from fleet.runtime.decoding import decode_json

SHOWN = 50  # ended runs shown
_encode = msgspec.json.encode


class MissionQueries:
    """Answers the queries of one edge. ``soon`` runs a call on the event loop, from any thread."""

    def __init__(
        self,
        edge: str,
        bus_session: ZenohSession,
        missions: KnownMissions,
        runs: Runs,
        *,
        requesters: MissionRequesters,
        starts: StartRequests,
        rehearsals: Rehearsals,
        results: RunResults,
        store: RunStore,
        soon: Callable[[Callable[[], None]], None],
    ) -> None:
        self._edge = edge
        self._bus_session = bus_session
        self._missions = missions
        self._runs = runs
        self._requesters = requesters
        self._starts = starts
        self._rehearsals = rehearsals
        self._results = results
        self._store = store
        self._soon = soon

    def declare(self) -> None:
        """Start answering."""
        self._bus_session.declare_queryable(
            keys.mission(self._edge, "*"), self._mission, more=keys.SENDER_SUFFIX
        )
        self._bus_session.declare_queryable(keys.run(self._edge, "*"), self._run, more=keys.SENDER_SUFFIX)

    # -- missions ------------------------------------------------------------------------------------

    def _mission(self, question: Query) -> None:
        """Receive a query for a mission; on the bus's thread."""
        name, do = question.requested.rpartition("/")[2], question.parameters.get("do")
        if do == "rehearsal":
            self._soon(partial(self._rehearsals.answer_state, question))
            return
        if do not in {"start", "rehearse"}:
            for each in self._missions.by_name.values():
                if "*" in name or each.name == name:
                    question.reply(
                        _encode(mission_state(each, self._edge)), keys.mission(self._edge, each.name)
                    )
            question.close()
            return

        def made() -> tuple[Mission, MissionStartRequest]:
            request = self._requesters.start(question)
            return self._missions.requested(name, request), request

        began = partial(self._answer_started, name, question)
        if do == "rehearse":
            self._starts.check(made, partial(self._rehearsals.begin, question), began)
        else:
            self._starts.begin(made, Transport.BUS, began)

    def _answer_started(
        self, name: str, question: Query, run: str, roles: Mapping[str, Sequence[str]], refusal: str
    ) -> None:
        """Answer whether a run was started, with its robots."""
        started = Started(run, {role: list(robots) for role, robots in roles.items()}, refusal)
        question.answer(_encode(started), keys.mission(self._edge, name))

    # -- runs ----------------------------------------------------------------------------------------

    def _run(self, question: Query) -> None:
        """Receive a query for a run; on the bus's thread."""
        self._soon(partial(self._answer_run, question, question.requested.rpartition("/")[2]))

    def _answer_run(self, question: Query, run: str) -> None:
        """Answer with states, or control a run."""
        if not question.payload:
            self._answer_states(question, run)
            return
        key = keys.run(self._edge, run)

        def on_answer(refusal: str) -> None:
            question.answer(_encode(Controlled(refusal)), key)

        try:
            request = decode_json(question.payload, RunControlRequest)
        except msgspec.DecodeError as error:
            on_answer(str(error))
            return
        if request.do == "log":
            self._store.story(run, partial(self._answer_story, question, run))
            return
        if request.do == "results":
            self._results.answer(question, key, run)
            return
        try:
            self._runs.control(run, self._requesters.control(question, run, request), on_answer)
        except Refused as error:
            on_answer(str(error))

    def _answer_story(self, question: Query, run: str, story: list[RunLogEntry]) -> None:
        """Answer with a run's log; without a reply for a run of another edge."""
        if story:
            question.reply(_encode(story), keys.run(self._edge, run))
        question.close()

    def _answer_states(self, question: Query, run: str) -> None:
        """Answer with the states of the requested runs: running ones first, then ended ones."""
        active = self._runs.states()
        for state in active:
            if "*" in run or state.run == run:
                question.reply(_encode(state), keys.run(self._edge, state.run))
        shown = {state.run for state in active}

        def ended(found: list[tuple[RunOrigin, RunHead, list[RunMember]]]) -> None:
            for about, head, members in found:
                if about.run not in shown and ("*" in run or about.run == run):
                    state = ended_state(about, head, members, self._edge)
                    question.reply(_encode(state), keys.run(self._edge, about.run))
            question.close()

        self._store.ended(SHOWN, ended)
