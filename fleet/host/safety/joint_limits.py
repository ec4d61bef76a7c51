"""Joint targets kept within what the robot declares: beyond a range refused, beyond a speed slowed; pure."""

from __future__ import annotations

import math
from collections.abc import Mapping

from fleet.model.joints import JointRange


def refusal(targets: Mapping[str, float], ranges: Mapping[str, JointRange]) -> str | None:
    """Return why a robot with joints of these ranges does not take targets (rad, or m); None when it does."""
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
    """Return how far a joint may go from ``at`` towards its target in so many seconds, within its range.

    One that is outside its range, because it was pushed there, comes back at its speed.
    """
    most = bounds.speed * seconds
    return at + max(-most, min(most, min(max(target, bounds.least), bounds.most) - at))
