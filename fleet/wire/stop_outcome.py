"""How a robot's emergency stop goes, by a state that was made after the stop was set; pure."""

from __future__ import annotations

from fleet.model.command import ReplyStatus
from fleet.model.state import RobotState
from fleet.wire.stops import EMERGENCY

SEEN_WITHIN = 8.0  # s; an adapter has 5 to bring its robot to a standstill
DONE = "done"
UNSEEN = "no state of it came after the stop"
OPEN = ("under way", ReplyStatus.ACCEPTED.value, UNSEEN)
"""Outcomes that may still become another."""


def stop_outcome(state: RobotState, first: float) -> str:
    """Return how a robot's stop goes by its state; ``first``: the stamp of the first such state.

    A state that tells of another command may be from before the stop: it counts once it was made anew.
    """
    if state.last_command == EMERGENCY:
        return state.last_outcome
    return DONE if state.emergency_stop and state.reachable and state.stamp > first else UNSEEN
