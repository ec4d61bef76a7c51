"""Statuses of one robot's actions by action id, and the answers to repeated ids."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from fleet.clock import Clock
from fleet.host.journal.journal import RobotJournal
from fleet.host.journal.past_commands import PastCommand, answer_to
from fleet.host.requests.receipt import Receipt
from fleet.model.command import Reply
from fleet.model.navigation import ActionState, Navigate
from fleet.model.report import NavigationReport

KEPT = 64  # actions remembered, to answer a repeated action id with its last status


class _ActionRecord(msgspec.Struct):
    """Latest status of an action id, and the receipt of its first request."""

    receipt: Receipt
    status: NavigationReport


class ActionStatuses:
    """Newest status of each action id, including actions of an earlier process.

    ``publish`` sends a status; the end of an action is written to the ``journal`` before that.
    """

    def __init__(
        self, publish: Callable[[NavigationReport], None], clock: Clock, journal: RobotJournal
    ) -> None:
        self._publish = publish
        self._clock = clock
        self._journal = journal
        self._records = {
            past.identity: _record_of(past, clock.time()) for past in journal.past if past.action
        }

    def recall(self) -> None:
        """Publish how the actions ended that an earlier process left unfinished; once, at the start."""
        for past in self._journal.past:
            if past.action and not past.outcome:
                self.publish(self._records[past.identity].status)

    def knows(self, action_id: str) -> bool:
        """Return True for an action id seen before."""
        return action_id in self._records

    def repeated(self, action_id: str, receipt: Receipt) -> bool:
        """Repeat the last status and the answers of a known action id; return False for a new one."""
        known = self._records.get(action_id)
        if known is None:
            return False
        self._publish(known.status)
        receipt.follow(known.receipt)
        return True

    def refuse(self, request: Navigate, reason: str, receipt: Receipt) -> None:
        """Report that an action failed before it started; a repeat gets the same refusal."""
        step, now = 0 if request.of_mission else None, self._clock.time()
        status = NavigationReport(now, request.action_id, ActionState.FAILED, 0.0, reason, step)
        self._publish(status)
        self.remember(status, receipt)

    def controlled(self, request: Navigate, reply: Reply) -> None:
        """Report the end of a control message that has an action id of its own."""
        if reply.done is None or not request.action_id or self.knows(request.action_id):
            return
        state, percent = (ActionState.COMPLETED, 100.0) if reply.done else (ActionState.FAILED, 0.0)
        step = 0 if request.of_mission else None
        if request.of_mission and reply.done:
            state = ActionState.CANCELLED
        self._publish(
            NavigationReport(self._clock.time(), request.action_id, state, percent, reply.reason, step)
        )

    def publish(self, status: NavigationReport) -> None:
        """Publish a status and keep it for repeats of its id."""
        known = self._records.get(status.action_id)
        if known is not None:
            known.status = status
        if status.state.terminal:
            self._journal.end(status.action_id, status.state.value)
        self._publish(status)

    def remember(self, status: NavigationReport, receipt: Receipt) -> None:
        """Keep an action for repeats of its id; the oldest beyond ``KEPT`` is dropped."""
        if not status.action_id:
            return
        self._records[status.action_id] = _ActionRecord(receipt, status)
        while len(self._records) > KEPT:
            del self._records[next(iter(self._records))]


def _record_of(past: PastCommand, now: float) -> _ActionRecord:
    """Return the record of an action of an earlier process; an interrupted one has failed."""
    state = ActionState(past.outcome) if past.outcome else ActionState.FAILED
    progress = 100.0 if state is ActionState.COMPLETED else 0.0
    return _ActionRecord(answer_to(past), NavigationReport(now, past.identity, state, progress, past.verdict))
