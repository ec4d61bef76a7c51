"""Stages of a stop, and the mode that each leads to.

The stage beyond these is hardware (a button, the drives' watchdogs): armed here, executed there.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Stage(enum.IntEnum):
    """Ordered: higher is harder."""

    NONE = 0
    SLOW = 1  # velocity to zero, stand
    SIT = 2  # finish the step, stand, lower, damp, off
    DAMP = 3  # damp and lower at once, then off; latched


class Mode(enum.StrEnum):
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


EMERGENCY_STOP = "emergency stop"
"""Cause of the only latched stop that a new request to get up clears, once the host has released it."""

TOLD_TO_LEAVE = "told to leave"
"""Cause of the stop when the controller is dismissed."""

MEANT = frozenset({EMERGENCY_STOP, TOLD_TO_LEAVE})
"""Causes that are intended: no fault that a person has to inspect."""


class Trip(NamedTuple):
    """Stage and cause of a stop; the cause names joint, object, target and actual value."""

    stage: Stage
    cause: str


FORCED: Mapping[Stage, Mapping[Mode, Mode]] = MappingProxyType(
    {
        Stage.SIT: MappingProxyType(
            {
                Mode.ENABLING: Mode.OFF,
                Mode.RISING: Mode.SITTING,
                Mode.STANDING: Mode.SITTING,
                Mode.WALKING: Mode.SITTING,
                Mode.RECOVERING: Mode.DAMPED,
                Mode.CHECKING: Mode.DAMPED,
                Mode.POSING: Mode.SITTING,
                Mode.HELD: Mode.SITTING,
            }
        ),
        Stage.DAMP: MappingProxyType(
            {mode: Mode.DAMPED for mode in Mode if mode not in {Mode.OFF, Mode.DAMPED}}
        ),
    }
)
"""Mode after a trip; other modes stay."""

POSED = frozenset({Mode.POSING, Mode.HELD})
"""Modes that hold a posture independent of the gait."""

UPRIGHT = POSED | {Mode.RISING, Mode.STANDING, Mode.WALKING, Mode.SITTING, Mode.CHECKING}
"""Modes in which a tilt means that the robot is falling."""

POSITIONED = UPRIGHT | {Mode.RECOVERING}
"""Modes in which the drives hold positions."""


def forced(stage: Stage, mode: Mode) -> Mode:
    """Return the mode that a trip of this stage leads to."""
    return FORCED.get(stage, {}).get(mode, mode)
