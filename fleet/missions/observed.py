"""What a run takes from the states and answers of its robots: facts, outcomes, whether one has left."""

from __future__ import annotations

from fleet.clock import Clock
from fleet.missions.state import Facts, Outcome
from fleet.model.command import Reply, ReplyStatus
from fleet.model.state import RobotState

SHOWN_WITHIN = 5.0  # s in which the state of a robot that has joined a run says so, from a worker too
_LEFT = {"stopped": Outcome.STOPPED, "lost": Outcome.LOST, "taken": Outcome.TAKEN}


class Membership:
    """Which robots of a run have left it, as their states say."""

    def __init__(self, run: str, clock: Clock) -> None:
        self._run = run
        self._clock = clock
        self._joined: dict[str, float] = {}

    def joined(self, robot: str) -> None:
        """Note that a robot has joined: a state from before, which a worker may still send, says nothing."""
        self._joined[robot] = self._clock.monotonic()

    def why_left(self, state: RobotState) -> tuple[Outcome, str] | None:
        """Return how and why a robot has left the run; None while it is in it."""
        if state.emergency_stop:
            return Outcome.STOPPED, state.stop_cause or "its emergency stop is set"
        if not state.reachable:
            return Outcome.LOST, state.cause or "it does not answer"
        if state.run == self._run:
            self._joined.pop(state.name, None)
            return None
        if self._clock.monotonic() - self._joined.get(state.name, float("-inf")) < SHOWN_WITHIN:
            return None
        word, _, reason = state.left_run.partition(": ")
        return _LEFT.get(word, Outcome.LOST), reason or "its process began anew"


def outcome_of(reply: Reply) -> Outcome | None:
    """Return how a part ended by a robot's answer; None for a receipt, after which the end is to come."""
    if reply.done:
        return Outcome.DONE
    if reply.done is None:
        if reply.ok:
            return None
        return Outcome.UNKNOWN if reply.status is ReplyStatus.TIMEOUT else Outcome.REFUSED
    return Outcome.LATE if reply.status is ReplyStatus.TIMEOUT else Outcome.FAILED


def facts_of(state: RobotState) -> Facts:
    """Return what is seen of a robot; its place is in the site's frame, else in its own world."""
    at = state.site or state.position
    position = (at.x, at.y, at.z) if at is not None else None
    return Facts(state.name, state.health, state.battery, position, state.activity)
