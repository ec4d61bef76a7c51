"""Conversion of the states and answers of robots to facts, outcomes and departures of a run."""

from __future__ import annotations

from fleet.clock import Clock
from fleet.missions.state import Facts, PartOutcome
from fleet.model.command import Reply, ReplyStatus
from fleet.model.state import RobotState

SHOWN_WITHIN = 5.0  # s until the state of a robot that has joined a run shows it, also from a worker
_LEFT = {"stopped": PartOutcome.STOPPED, "lost": PartOutcome.LOST, "taken": PartOutcome.TAKEN}


class RunMembership:
    """Detects from their states which robots have left a run."""

    def __init__(self, run: str, clock: Clock) -> None:
        self._run = run
        self._clock = clock
        self._joined: dict[str, float] = {}

    def joined(self, robot: str) -> None:
        """Record that a robot has joined; an older state, which a worker may still send, proves nothing."""
        self._joined[robot] = self._clock.monotonic()

    def leave_reason(self, state: RobotState) -> tuple[PartOutcome, str] | None:
        """Return how and why a robot has left the run; None while it is in it."""
        if state.emergency_stop:
            return PartOutcome.STOPPED, state.stop_cause or "its emergency stop is set"
        if not state.reachable:
            return PartOutcome.LOST, state.cause or "it does not answer"
        if state.run == self._run:
            self._joined.pop(state.name, None)
            return None
        if self._clock.monotonic() - self._joined.get(state.name, float("-inf")) < SHOWN_WITHIN:
            return None
        word, _, reason = state.left_run.partition(": ")
        return _LEFT.get(word, PartOutcome.LOST), reason or "its process began anew"


def outcome_of(reply: Reply) -> PartOutcome | None:
    """Return the outcome of a part from a robot's answer; None for a receipt, which an outcome follows."""
    if reply.done:
        return PartOutcome.DONE
    if reply.done is None:
        if reply.ok:
            return None
        return PartOutcome.UNKNOWN if reply.status is ReplyStatus.TIMEOUT else PartOutcome.REFUSED
    return PartOutcome.LATE if reply.status is ReplyStatus.TIMEOUT else PartOutcome.FAILED


def facts_of(state: RobotState) -> Facts:
    """Return the facts of a robot; its position is in the site's frame, else in its own world frame."""
    at = state.site or state.position
    position = (at.x, at.y, at.z) if at is not None else None
    return Facts(state.name, state.health, state.battery, position, state.activity)
