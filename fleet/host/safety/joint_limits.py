"""Limits of joint targets: refuse a target outside its range, slow down one beyond its speed. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping

from fleet.model.joints import JointRange


def refusal(targets: Mapping[str, float], ranges: Mapping[str, JointRange]) -> str | None:
    """Return why joints with these ranges cannot take the targets (rad, or m); None when they can."""
    if not ranges:
        return "it takes no joint targets"
    for joint, target in targets.items():
        bounds = ranges.get(joint)
        if bounds is None:
            return f"it has no joint {joint[:40]!a} that takes targets; it has {', '.join(sorted(ranges))}"
        if not math.isfinite(target):
            return f"joint {joint}: a finite number is needed"
        if not bounds.least <= target <= bounds.most:
            return f"joint {joint}: {target:.4g} is outside {bounds}"
    return None


def approach(at: float, target: float, bounds: JointRange, seconds: float) -> float:
    """Return the joint's position after ``seconds`` of approach from ``at`` to its target, within its range.

    A joint outside its range, because it was pushed there, returns at its own speed.
    """
    most = bounds.speed * seconds
    return at + max(-most, min(most, min(max(target, bounds.least), bounds.most) - at))
