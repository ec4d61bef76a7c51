"""Reports runs of missions: states on the bus, start and end in the history."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.missions.report import RunState
from fleet.model.event import EventKind, EventReport, Requester, Severity


class RunReporter:
    """Reports the runs of one edge. ``record`` adds an event to its history.

    ``starter`` returns who started a run. ``listeners`` are called with each state, after the history and
    before the bus.
    """

    def __init__(
        self,
        edge: str,
        bus_session: ZenohSession,
        record: Callable[[str, EventReport], None],
        starter: Callable[[RunState], Requester],
        clock: Clock,
    ) -> None:
        self.listeners: list[Callable[[RunState], None]] = []
        self._edge = edge
        self._record = record
        self._starter = starter
        self._clock = clock
        self._states = bus_session.publishers(keys.run(edge, "*"))
        self._recorded: set[str] = set()  # runs whose start is in the history, and not yet their end

    def report(self, state: RunState) -> None:
        """Report the state of a run that has changed."""
        if state.run not in self._recorded:
            self._recorded.add(state.run)
            robots = ", ".join(f"{each.role} {each.robot}" for each in state.robots)
            how = "started" if state.seconds < 1.0 else "taken up again"
            self._event(state, EventKind.COMMAND, f"mission {state.mission} {how}: {robots}")
        if state.outcome:
            self._recorded.discard(state.run)
            reason = f": {state.reason}" if state.reason else ""
            self._event(state, EventKind.OUTCOME, f"mission {state.mission} {state.outcome}{reason}")
        for listener in self.listeners:
            listener(state)
        publisher = self._states.wanted(keys.run(self._edge, state.run))
        if publisher is not None:
            publisher.put(msgspec.json.encode(state))

    def _event(self, state: RunState, kind: EventKind, text: str) -> None:
        """Add an event of a run, with its requester, to the history of the edge."""
        requester = self._starter(state)
        severity = Severity.INFO if state.outcome in ("", "completed") else Severity.WARNING
        event = EventReport(self._clock.time(), kind, text, severity, requester, state.mission, state.run)
        self._record("", event)
