"""Stages of a stop, and the mode that each leads to.

The stage beyond these is hardware (a button, the drives' watchdogs): armed here, executed there.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class StopStage(enum.IntEnum):
    """Ordered: higher is harder."""

    NONE = 0
    SLOW = 1  # velocity to zero, stand
    SIT = 2  # finish the step, stand, lower, damp, off
    DAMP = 3  # damp and lower at once, then off; latched


class BodyMode(enum.StrEnum):
    """Mode of the body."""

    OFF = "off"
    ENABLING = "enabling"
    RISING = "rising"
    STANDING = "standing"
    WALKING = "walking"
    SITTING = "sitting"
    SETTLING = "settling"  # folded, damped, about to be off
    RECOVERING = "recovering"
    CHECKING = "checking"  # small moves of the trunk that show signs and offsets
    POSING = "posing"  # single joints move, near the posture at the start
    HELD = "held"  # holds the posture after joint moves
    DAMPED = "damped"  # hard stop; off follows
    UNKNOWN = "unknown"  # of a self-walking machine: its number is missing from the description


EMERGENCY_STOP = "emergency stop"
"""Cause of the only latched stop that a new request to get up clears, once the host has released it."""

REQUESTED_TO_LEAVE = "the controller was dismissed"
"""Cause of the stop when the controller is dismissed."""

MEANT = frozenset({EMERGENCY_STOP, REQUESTED_TO_LEAVE})
"""Causes that are intended: no fault that a person has to inspect."""


class Trip(NamedTuple):
    """Stage and cause of a stop; the cause names joint, object, target and actual value."""

    stage: StopStage
    cause: str


FORCED: Mapping[StopStage, Mapping[BodyMode, BodyMode]] = MappingProxyType(
    {
        StopStage.SIT: MappingProxyType(
            {
                BodyMode.ENABLING: BodyMode.OFF,
                BodyMode.RISING: BodyMode.SITTING,
                BodyMode.STANDING: BodyMode.SITTING,
                BodyMode.WALKING: BodyMode.SITTING,
                BodyMode.RECOVERING: BodyMode.DAMPED,
                BodyMode.CHECKING: BodyMode.DAMPED,
                BodyMode.POSING: BodyMode.SITTING,
                BodyMode.HELD: BodyMode.SITTING,
            }
        ),
        StopStage.DAMP: MappingProxyType(
            {mode: BodyMode.DAMPED for mode in BodyMode if mode not in {BodyMode.OFF, BodyMode.DAMPED}}
        ),
    }
)
"""Mode after a trip; other modes stay."""

POSED = frozenset({BodyMode.POSING, BodyMode.HELD})
"""Modes that hold a posture independent of the gait."""

UPRIGHT = POSED | {BodyMode.RISING, BodyMode.STANDING, BodyMode.WALKING, BodyMode.SITTING, BodyMode.CHECKING}
"""Modes in which a tilt means that the robot is falling."""

POSITIONED = UPRIGHT | {BodyMode.RECOVERING}
"""Modes in which the drives hold positions."""


def forced(stage: StopStage, mode: BodyMode) -> BodyMode:
    """Return the mode that a trip of this stage leads to."""
    return FORCED.get(stage, {}).get(mode, mode)
