"""What a command does to the motion of a vehicle, which decides whether a halt ends its repetition."""

from __future__ import annotations

import enum

from fleet_mavlink.constants import Cmd
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.messages import Ask, CommandInt
from fleet_mavlink.state import VehicleState


class Effect(enum.Enum):
    """Effect of a command on the motion of the vehicle."""

    NONE = "none"  # a payload, a setting, or a stop
    MOTION = "motion"
    COMING_DOWN = "coming down"  # the autopilot's own landing or way home


HALTED = frozenset({Effect.MOTION})
"""What a halt ends. A landing or a way home goes on: in the air it is safer than a hold."""
EMERGENCY_HALTED = HALTED | {Effect.COMING_DOWN}

_STARTING = frozenset(
    {
        Cmd.NAV_TAKEOFF,
        Cmd.COMPONENT_ARM_DISARM,
        Cmd.DO_CHANGE_SPEED,
        Cmd.DO_SET_REVERSE,
        Cmd.DO_SET_MISSION_CURRENT,
    }
)
"""Commands of a start that lead to no mode of their own: motion follows them."""


def effect_of(ask: Ask) -> Effect:
    """Return the effect of a command that is not a change of mode."""
    disarms = ask.command == Cmd.COMPONENT_ARM_DISARM and ask.param1 == 0.0
    return Effect.MOTION if ask.command in _STARTING and not disarms else Effect.NONE


def effect_of_change(mode: str, ask: Ask, flavour: Flavour | None, state: VehicleState) -> Effect:
    """Return the effect of a command that leads to ``mode``; a vehicle without a flavour is only braked.

    A place is motion whatever the mode: PX4 shows the mode of its hold on the way to a place.
    """
    if flavour is None:
        return Effect.NONE
    if isinstance(ask, CommandInt):
        return Effect.MOTION
    if mode == flavour.hold or any(mode == brake.mode for brake in flavour.brakes(state)):
        return Effect.NONE
    if not flavour.surface and mode in {flavour.land, flavour.return_home}:
        return Effect.COMING_DOWN
    return Effect.MOTION
