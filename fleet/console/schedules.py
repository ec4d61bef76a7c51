"""Schedules from the console: changed and started as from the command line, in the operator's name."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.console.requests import ScheduleChange
from fleet.console.sessions import ConsoleUser
from fleet.errors import Refused, TimedOut
from fleet.model.schedule import ScheduleAnswer, ScheduleRequest, ScheduleState
from fleet.runtime.decoding import decode_json

ANSWER_WITHIN = 15.0  # s for an edge to start a mission: its robots join the run first


def change(
    requested: ScheduleChange, bus_sessions: Iterable[ZenohSession], operator: ConsoleUser
) -> tuple[ScheduleState, ...]:
    """Change a schedule; return the new states of the edge's schedules. Raises Refused, TimedOut. Blocks."""
    key, wanted = keys.schedules(requested.edge), ScheduleRequest(requested.do, requested.name, operator.name)
    for bus_session in bus_sessions:
        to = keys.as_console(key, operator.permission.word, bus_session.identity)
        for _, data in bus_session.request(to, msgspec.json.encode(wanted), timeout=ANSWER_WITHIN):
            answer = decode_json(data, ScheduleAnswer)
            if answer.refusal:
                raise Refused(answer.refusal)
            return answer.schedules
    raise TimedOut(f"no edge answers on {key}")
