"""What is said of the actions of one robot, by their ids: each status, and the answer to a repeated id."""

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


class _Known(msgspec.Struct):
    """What was said last of an action id, and to whom."""

    receipt: Receipt
    status: NavigationReport


class ActionStatuses:
    """The newest status of each action id, also of those that an earlier process took.

    ``publish`` tells a status; the end of an action is in the ``journal`` first.
    """

    def __init__(
        self, publish: Callable[[NavigationReport], None], clock: Clock, journal: RobotJournal
    ) -> None:
        self._tell = publish
        self._clock = clock
        self._journal = journal
        self._known = {past.identity: _known_of(past, clock.time()) for past in journal.past if past.action}

    def recall(self) -> None:
        """Say how the actions ended that an earlier process did not see to their end; once, at the start."""
        for past in self._journal.past:
            if past.action and not past.outcome:
                self.publish(self._known[past.identity].status)

    def knows(self, action_id: str) -> bool:
        """Return True for the id of an action that was asked before."""
        return action_id in self._known

    def repeated(self, action_id: str, receipt: Receipt) -> bool:
        """Say the last status and the answers again for an action id seen before; False for a new one."""
        known = self._known.get(action_id)
        if known is None:
            return False
        self._tell(known.status)
        receipt.follow(known.receipt)
        return True

    def refuse(self, ask: Navigate, reason: str, receipt: Receipt) -> None:
        """Say that an action failed before it began; a repeat of it is refused like it."""
        step, now = 0 if ask.of_mission else None, self._clock.time()
        status = NavigationReport(now, ask.action_id, ActionState.FAILED, 0.0, reason, step)
        self._tell(status)
        self.remember(status, receipt)

    def controlled(self, ask: Navigate, reply: Reply) -> None:
        """Say how a control message ended, when it has an action id of its own and has ended."""
        if reply.done is None or not ask.action_id or self.knows(ask.action_id):
            return
        state, percent = (ActionState.COMPLETED, 100.0) if reply.done else (ActionState.FAILED, 0.0)
        step = 0 if ask.of_mission else None
        if ask.of_mission and reply.done:
            state = ActionState.CANCELLED
        self._tell(NavigationReport(self._clock.time(), ask.action_id, state, percent, reply.reason, step))

    def publish(self, status: NavigationReport) -> None:
        """Say a status, and keep it for repeats of its id."""
        known = self._known.get(status.action_id)
        if known is not None:
            known.status = status
        if status.state.terminal:
            self._journal.end(status.action_id, status.state.value)
        self._tell(status)

    def remember(self, status: NavigationReport, receipt: Receipt) -> None:
        """Keep an action for repeats of its id."""
        if not status.action_id:
            return
        self._known[status.action_id] = _Known(receipt, status)
        while len(self._known) > KEPT:
            del self._known[next(iter(self._known))]


def _known_of(past: PastCommand, now: float) -> _Known:
    """Return what is known of an action of an earlier process; one that was cut off has failed."""
    state = ActionState(past.outcome) if past.outcome else ActionState.FAILED
    progress = 100.0 if state is ActionState.COMPLETED else 0.0
    return _Known(answer_to(past), NavigationReport(now, past.identity, state, progress, past.verdict))
