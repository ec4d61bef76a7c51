"""Which drives may carry the dog, and which buses are silent: what decides whether the torque may go off."""

from __future__ import annotations

from collections.abc import Sequence

from fleet_quadruped.drives.base import HOLDING, Joints, Power
from fleet_quadruped.robot.description import Joint

_OFF = frozenset({Power.DISABLED, Power.FAULT})


def holding(joints: Sequence[Joint], told: Joints) -> str:
    """Return which drive may hold the dog, and how; empty when none does."""
    for joint, power in zip(joints, told.powers, strict=True):
        if power in HOLDING:
            return f"{joint.name}: the drive is {power.value}"
    return ""


def all_off(told: Joints, most: float) -> bool:
    """Return True when every drive has said within ``most`` s that its torque is off."""
    return max(told.ages) <= most and _OFF.issuperset(told.powers)


def silent_bus(joints: Sequence[Joint], ages: Sequence[float], most: float) -> str:
    """Return the bus of which every drive has been silent for more than ``most`` s; empty without one."""
    buses = dict.fromkeys(joint.bus for joint in joints)
    for joint, age in zip(joints, ages, strict=True):
        if age <= most:
            buses.pop(joint.bus, None)
    return next(iter(buses), "")
