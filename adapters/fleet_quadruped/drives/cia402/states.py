"""The CiA 402 state machine as tables: status word to state, goal and state to control word."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping
from types import MappingProxyType

from fleet_quadruped.drives.base import Power


class DriveState(enum.StrEnum):
    """States of CiA 402, by their names in the standard."""

    NOT_READY = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    ENABLED = "operation enabled"
    QUICK_STOP = "quick stop active"
    FAULT_REACTION = "fault reaction active"
    FAULT = "fault"


class DriveGoal(enum.StrEnum):
    """Goal state of a drive."""

    OFF = "off"
    ENABLE = "enable"
    HOLD = "hold"  # stay enabled, do not enable
    LOWER = "lower"  # like HOLD, and leave a quick stop that holds (605Ah is 5 to 7)
    STOP = "stop"
    RESET = "reset"


# Copies of the tables in ``canopen.profiles.p402``: importing it takes 0.1 s, too long for programs that only
# read the description. A test compares both.
_LOOSE: Mapping[int, DriveState] = MappingProxyType(
    {
        0x00: DriveState.NOT_READY,
        0x40: DriveState.SWITCH_ON_DISABLED,
        0x0F: DriveState.FAULT_REACTION,
        0x08: DriveState.FAULT,
    }
)
_STRICT: Mapping[int, DriveState] = MappingProxyType(
    {
        0x21: DriveState.READY,
        0x23: DriveState.SWITCHED_ON,
        0x27: DriveState.ENABLED,
        0x07: DriveState.QUICK_STOP,
    }
)
_STATES = tuple(
    _LOOSE.get(status & 0x4F) or _STRICT.get(status) or DriveState.NOT_READY for status in range(0x70)
)
FOLLOWS = 1 << 12  # status word: the drive follows the target in cyclic synchronous position mode


def state_of(status: int) -> DriveState:
    """Return the state encoded in a status word (6041h)."""
    return _STATES[status & 0x6F]


DISABLE_VOLTAGE, QUICK_STOP, SHUTDOWN, SWITCH_ON, ENABLE, RESET = 0x00, 0x02, 0x06, 0x07, 0x0F, 0x80

_TOWARDS: Mapping[DriveGoal, Mapping[DriveState, int]] = MappingProxyType(
    {
        DriveGoal.OFF: MappingProxyType({}),
        DriveGoal.ENABLE: MappingProxyType(
            {
                DriveState.SWITCH_ON_DISABLED: SHUTDOWN,
                DriveState.READY: SWITCH_ON,
                DriveState.SWITCHED_ON: ENABLE,
                DriveState.ENABLED: ENABLE,
            }
        ),
        DriveGoal.HOLD: MappingProxyType({DriveState.ENABLED: ENABLE, DriveState.QUICK_STOP: QUICK_STOP}),
        DriveGoal.LOWER: MappingProxyType({DriveState.ENABLED: ENABLE, DriveState.QUICK_STOP: ENABLE}),
        DriveGoal.STOP: MappingProxyType({DriveState.ENABLED: QUICK_STOP, DriveState.QUICK_STOP: QUICK_STOP}),
        DriveGoal.RESET: MappingProxyType({DriveState.FAULT: RESET}),
    }
)


def control_words(goal: DriveGoal, states: Iterable[DriveState]) -> list[int]:
    """Return the control words (6040h) of the next step; without one, disable voltage."""
    towards = _TOWARDS[goal]
    return [towards.get(state, DISABLE_VOLTAGE) for state in states]


POWER: Mapping[DriveState, Power] = MappingProxyType(
    {
        DriveState.NOT_READY: Power.DISABLED,
        DriveState.SWITCH_ON_DISABLED: Power.DISABLED,
        DriveState.READY: Power.STARTING,
        DriveState.SWITCHED_ON: Power.STARTING,
        DriveState.ENABLED: Power.ENABLED,
        DriveState.QUICK_STOP: Power.STOPPING,
        DriveState.FAULT_REACTION: Power.FAULT,
        DriveState.FAULT: Power.FAULT,
    }
)
