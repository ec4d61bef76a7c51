"""The CiA 402 state machine as tables: status word to state, goal and state to control word."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping
from types import MappingProxyType

from fleet_quadruped.drives.base import Power


class State(enum.StrEnum):
    """The states of CiA 402 in their own words."""

    NOT_READY = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    ENABLED = "operation enabled"
    QUICK_STOP = "quick stop active"
    FAULT_REACTION = "fault reaction active"
    FAULT = "fault"


class Goal(enum.StrEnum):
    """Where a drive is to be brought."""

    OFF = "off"
    ENABLE = "enable"
    HOLD = "hold"  # enabled where it is so already
    LOWER = "lower"  # the same, and on from a quick stop that holds (605Ah is 5 to 7)
    STOP = "stop"
    RESET = "reset"


_LOOSE: Mapping[int, State] = MappingProxyType(
    {0x00: State.NOT_READY, 0x40: State.SWITCH_ON_DISABLED, 0x0F: State.FAULT_REACTION, 0x08: State.FAULT}
)
_STRICT: Mapping[int, State] = MappingProxyType(
    {0x21: State.READY, 0x23: State.SWITCHED_ON, 0x27: State.ENABLED, 0x07: State.QUICK_STOP}
)
_STATES = tuple(_LOOSE.get(status & 0x4F) or _STRICT.get(status) or State.NOT_READY for status in range(0x70))
FOLLOWS = 1 << 12  # status word: in cyclic synchronous position the drive follows the target


def state_of(status: int) -> State:
    """Return the state that a status word (6041h) tells."""
    return _STATES[status & 0x6F]


DISABLE_VOLTAGE, QUICK_STOP, SHUTDOWN, SWITCH_ON, ENABLE, RESET = 0x00, 0x02, 0x06, 0x07, 0x0F, 0x80

_TOWARDS: Mapping[Goal, Mapping[State, int]] = MappingProxyType(
    {
        Goal.OFF: MappingProxyType({}),
        Goal.ENABLE: MappingProxyType(
            {
                State.SWITCH_ON_DISABLED: SHUTDOWN,
                State.READY: SWITCH_ON,
                State.SWITCHED_ON: ENABLE,
                State.ENABLED: ENABLE,
            }
        ),
        Goal.HOLD: MappingProxyType({State.ENABLED: ENABLE, State.QUICK_STOP: QUICK_STOP}),
        Goal.LOWER: MappingProxyType({State.ENABLED: ENABLE, State.QUICK_STOP: ENABLE}),
        Goal.STOP: MappingProxyType({State.ENABLED: QUICK_STOP, State.QUICK_STOP: QUICK_STOP}),
        Goal.RESET: MappingProxyType({State.FAULT: RESET}),
    }
)


def control_words(goal: Goal, states: Iterable[State]) -> list[int]:
    """Return the control words (6040h) for the next step; without a step the voltage is disabled."""
    towards = _TOWARDS[goal]
    return [towards.get(state, DISABLE_VOLTAGE) for state in states]


POWER: Mapping[State, Power] = MappingProxyType(
    {
        State.NOT_READY: Power.DISABLED,
        State.SWITCH_ON_DISABLED: Power.DISABLED,
        State.READY: Power.STARTING,
        State.SWITCHED_ON: Power.STARTING,
        State.ENABLED: Power.ENABLED,
        State.QUICK_STOP: Power.STOPPING,
        State.FAULT_REACTION: Power.FAULT,
        State.FAULT: Power.FAULT,
    }
)
