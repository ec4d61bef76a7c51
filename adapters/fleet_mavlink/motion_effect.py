"""Effect of a command on the motion of a vehicle: decides whether a halt ends its repetition."""

from __future__ import annotations

import enum

from fleet_mavlink.constants import MavCmd
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.messages import MavlinkCommand


class Effect(enum.Enum):
    """Effect of a command on the motion of the vehicle."""

    NONE = "none"  # a payload, a setting, or a stop
    MOTION = "motion"
    COMING_DOWN = "coming down"  # the autopilot's own landing or return home


HALTED = frozenset({Effect.MOTION})
"""Effects that a halt ends. A landing or return home continues: in the air it is safer than a hold."""
EMERGENCY_HALTED = HALTED | {Effect.COMING_DOWN}

_STARTING = frozenset(
    {
        MavCmd.NAV_TAKEOFF,
        MavCmd.COMPONENT_ARM_DISARM,
        MavCmd.DO_CHANGE_SPEED,
        MavCmd.DO_SET_REVERSE,
        MavCmd.DO_SET_MISSION_CURRENT,
        MavCmd.DO_VTOL_TRANSITION,
    }
)
"""Commands of a start that lead to no mode of their own: motion follows them."""


def effect_of(request: MavlinkCommand) -> Effect:
    """Return the effect of a command that is not a change of mode."""
    disarms = request.command == MavCmd.COMPONENT_ARM_DISARM and request.param1 == 0.0
    return Effect.MOTION if request.command in _STARTING and not disarms else Effect.NONE


def effect_of_descent(flavour: Flavour) -> Effect:
    """Return the effect of a landing or return home: on the surface, standing still is safer."""
    return Effect.MOTION if flavour.surface else Effect.COMING_DOWN
