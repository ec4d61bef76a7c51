"""The stages of a stop, and what each does to a dog that is in some mode.

Hardware (a button, the drives' own watchdog) is the stage beyond these: ours to arm, not to run.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Stage(enum.IntEnum):
    """Ordered: a later one is harder."""

    NONE = 0
    SLOW = 1  # velocity to zero, stand
    SIT = 2  # finish the step, stand, lower, damp, off
    DAMP = 3  # give way slowly with damping at once, then off; latched


class Mode(enum.StrEnum):
    """What the body is doing."""

    OFF = "off"
    ENABLING = "enabling"
    RISING = "rising"
    STANDING = "standing"
    WALKING = "walking"
    SITTING = "sitting"
    SETTLING = "settling"  # folded, giving way, about to be off
    RECOVERING = "recovering"
    CHECKING = "checking"  # small moves of the trunk by which signs and offsets are seen
    POSING = "posing"  # its joints are led, near the posture in which that began
    HELD = "held"  # it holds the posture to which its joints were led
    DAMPED = "damped"  # stopped hard; off follows


EMERGENCY_STOP = "emergency stop"
"""The cause of the one latched stop that a new command to get up ends, once the host has released it."""

TOLD_TO_LEAVE = "told to leave"
"""The cause with which a dog sits down at the end of its controller."""

MEANT = frozenset({EMERGENCY_STOP, TOLD_TO_LEAVE})
"""Causes that somebody meant: no fault that would have to be understood."""


class Trip(NamedTuple):
    """Why the dog is to be stopped, and how hard; the cause names joint, object, wanted and actual."""

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
"""Where a trip takes the body; a mode that is not named stays."""

POSED = frozenset({Mode.POSING, Mode.HELD})
"""Modes in which it holds a posture of its own."""

UPRIGHT = POSED | {Mode.RISING, Mode.STANDING, Mode.WALKING, Mode.SITTING, Mode.CHECKING}
"""Modes in which tilting means falling."""

POSITIONED = UPRIGHT | {Mode.RECOVERING}
"""Modes in which the drives hold positions."""


def forced(stage: Stage, mode: Mode) -> Mode:
    """Return the mode that a trip of this stage leads to."""
    return FORCED.get(stage, {}).get(mode, mode)
