"""Missions from the console: started and controlled as from the command line, in the operator's name."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterable, Mapping, Sequence
from functools import partial
from typing import TypeVar

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.console.requests import PageMissionRequest, PageRehearseRequest, PageRunRequest
from fleet.console.sessions import ConsoleUser
from fleet.errors import Refused, TimedOut
from fleet.missions.rehearsal import RehearsalPoll, RehearsalState
from fleet.missions.report import Controlled, MissionStartRequest, RunControlRequest, Started
from fleet.runtime.decoding import decode_json

POLL_INTERVAL = 0.3  # s between polls of a rehearsal
ANSWER_WITHIN = 15.0  # s for an edge to start a mission: its robots join the run first

T = TypeVar("T")


def start(
    requested: PageMissionRequest, bus_sessions: Iterable[ZenohSession], operator: ConsoleUser, clock: Clock
) -> dict[str, object]:
    """Start a mission; return the answer for the page. Raises Refused, TimedOut. Blocks."""
    wanted = MissionStartRequest(inputs=requested.inputs, session_id=operator.name, timestamp=clock.time())
    key = keys.mission(requested.edge, requested.name)
    started = _request(key, wanted, Started, bus_sessions, operator, parameters={"do": "start"})
    if started.refusal:
        raise Refused(started.refusal, hint=started.hint)
    robots = ", ".join(name for names in started.roles.values() for name in names)
    return {"status": "accepted", "done": True, "reason": f"run {started.run} with {robots}"}


async def rehearse(
    requested: PageRehearseRequest, bus_sessions: Sequence[ZenohSession], operator: ConsoleUser
) -> AsyncIterator[RehearsalState]:
    """Rehearse a mission; yield its progress, the last one with its result. Raises Refused, TimedOut.

    To end it, stop iterating: the edge gives up a rehearsal that is no longer polled.
    """
    key = keys.mission(requested.edge, requested.name)
    wanted = MissionStartRequest(inputs=requested.inputs, session_id=operator.name)
    state = await _state(key, wanted, bus_sessions, operator, "rehearse")
    known = 0
    while state.result is None:
        yield state
        await asyncio.sleep(POLL_INTERVAL)
        known += len(state.notes)
        state = await _state(key, RehearsalPoll(state.id, known), bus_sessions, operator, "rehearsal")
    yield state


async def _state(
    key: str, wanted: msgspec.Struct, bus_sessions: Sequence[ZenohSession], operator: ConsoleUser, do: str
) -> RehearsalState:
    """Poll a rehearsal; raises Refused, TimedOut."""
    request = partial(_request, key, wanted, RehearsalState, bus_sessions, operator, parameters={"do": do})
    state = await asyncio.to_thread(request)
    if state.refusal or state.failure:
        raise Refused(f"it cannot be rehearsed: {state.refusal or state.failure}")
    return state


def control(
    requested: PageRunRequest, bus_sessions: Iterable[ZenohSession], operator: ConsoleUser
) -> dict[str, object]:
    """Control a run; return the answer for the page. Raises Refused, TimedOut. Blocks."""
    wanted = RunControlRequest(requested.do, requested.question, requested.goes_on, operator.name)
    controlled = _request(keys.run(requested.edge, requested.run), wanted, Controlled, bus_sessions, operator)
    if controlled.refusal:
        raise Refused(controlled.refusal)
    return {"status": "accepted", "done": True}


def _request(
    key: str,
    wanted: msgspec.Struct,
    kind: type[T],
    bus_sessions: Iterable[ZenohSession],
    operator: ConsoleUser,
    *,
    parameters: Mapping[str, str] | None = None,
) -> T:
    """Send a request to one edge, over each session in turn; raises TimedOut without an answer."""
    for bus_session in bus_sessions:
        requested = keys.as_console(key, operator.permission.word, bus_session.identity)
        for _, data in bus_session.request(
            requested, msgspec.json.encode(wanted), timeout=ANSWER_WITHIN, parameters=parameters
        ):
            return decode_json(data, kind)
    raise TimedOut(f"no edge answers on {key}")
