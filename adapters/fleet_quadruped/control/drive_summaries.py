"""Summaries of drive feedback as text: drives that hold, have failed or are not enabled; silent buses."""

from __future__ import annotations

from collections.abc import Sequence

from fleet_quadruped.drives.base import HOLDING, JointsFeedback, Power
from fleet_quadruped.robot.joint import Joint

_OFF = frozenset({Power.DISABLED, Power.FAULT})


def holding(joints: Sequence[Joint], reported: JointsFeedback) -> str:
    """Describe the first drive that may hold the robot; empty if there is none."""
    for joint, power in zip(joints, reported.powers, strict=True):
        if power in HOLDING:
            return f"{joint.name}: the drive is {power.value}"
    return ""


def all_off(reported: JointsFeedback, most: float) -> bool:
    """Return True if every drive has reported within ``most`` s that its torque is off."""
    return max(reported.ages) <= most and _OFF.issuperset(reported.powers)


def silent_bus(joints: Sequence[Joint], ages: Sequence[float], most: float) -> str:
    """Return a bus on which every drive has been silent for more than ``most`` s; empty without one."""
    buses = dict.fromkeys(joint.bus for joint in joints)
    for joint, age in zip(joints, ages, strict=True):
        if age <= most:
            buses.pop(joint.bus, None)
    return next(iter(buses), "")


def failed(joints: Sequence[Joint], reported: JointsFeedback) -> str:
    """Describe the first drive with a fault; empty if there is none."""
    if Power.FAULT not in reported.powers:
        return ""
    number = reported.powers.index(Power.FAULT)
    return f"{joints[number].name}: {reported.faults[number] or 'its drive reports a fault'}"


def not_enabled(joints: Sequence[Joint], reported: JointsFeedback) -> str:
    """Describe the first drive that is not enabled, with the reason; empty if all are."""
    if reported.all_enabled:
        return ""
    number = next(number for number, power in enumerate(reported.powers) if power is not Power.ENABLED)
    why = reported.faults[number] or f"wanted enabled, the drive is {reported.powers[number].value}"
    return f"{joints[number].name}: {why}"


def silent_joint(joints: Sequence[Joint], ages: Sequence[float], most: float) -> str:
    """Describe the first drive that has been silent for more than ``most`` s; empty without one."""
    for joint, age in zip(joints, ages, strict=True):
        if age > most:
            return f"{joint.name}: no feedback from id {joint.id} on bus {joint.bus}"
    return ""
