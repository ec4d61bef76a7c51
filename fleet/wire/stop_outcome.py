"""Outcome of an emergency stop, from states of the robot after the stop was set; pure."""

from __future__ import annotations

from fleet.model.command import ReplyStatus
from fleet.model.state import RobotState
from fleet.wire.stops import EMERGENCY

SEEN_WITHIN = 8.0  # s; an adapter has 5 s to bring its robot to a standstill
DONE = "done"
UNSEEN = "no state of it came after the stop"
OPEN = ("under way", ReplyStatus.ACCEPTED.value, UNSEEN)
"""Outcomes that may still change."""


def stop_outcome(state: RobotState, first: float) -> str:
    """Return the outcome of a robot's stop by its state; ``first``: the stamp of the first such state.

    A state whose last command is another one may be from before the stop, so it only counts if it is newer
    than the first.
    """
    if state.last_command == EMERGENCY:
        return state.last_outcome
    return DONE if state.emergency_stop and state.reachable and state.stamp > first else UNSEEN
