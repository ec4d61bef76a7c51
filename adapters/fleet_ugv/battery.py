"""State of charge of a battery from its voltage; pure."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

Curve = Sequence[tuple[float, float]]
"""Points of (volts, percent), both rising."""

THREE_LITHIUM: Curve = (
    (9.0, 0.0),
    (10.2, 5.0),
    (10.8, 20.0),
    (11.1, 40.0),
    (11.4, 60.0),
    (12.0, 85.0),
    (12.6, 100.0),
)
"""Three lithium cells in series under a light load."""

TEN_LITHIUM: Curve = tuple((volts * 10 / 3, percent) for volts, percent in THREE_LITHIUM)
"""Ten lithium cells in series, as in a hoverboard."""


def percent(voltage: float, curve: Curve) -> float:
    """Return 0 to 100 percent, interpolated linearly between the curve's points and clamped at its ends."""
    for (low, low_percent), (high, high_percent) in pairwise(curve):
        if voltage <= high:
            part = max(0.0, (voltage - low) / (high - low))
            return low_percent + part * (high_percent - low_percent)
    return curve[-1][1]


def voltage(charge: float, curve: Curve) -> float:
    """Return the volts at which a battery has so many percent: the inverse of ``percent``."""
    for (low, low_percent), (high, high_percent) in pairwise(curve):
        if charge <= high_percent:
            part = max(0.0, (charge - low_percent) / max(high_percent - low_percent, 1e-9))
            return low + part * (high - low)
    return curve[-1][0]


def checked_curve(points: Sequence[tuple[float, float]]) -> Curve:
    """Return a valid curve; raises ValueError when it does not rise or leaves 0 to 100 percent."""
    if len(points) < 2:
        raise ValueError("a battery curve needs two points at least")
    if any(low[0] >= high[0] or low[1] > high[1] for low, high in pairwise(points)):
        raise ValueError("a battery curve has rising volts and percents that do not fall")
    if points[0][1] < 0 or points[-1][1] > 100:
        raise ValueError("the percents of a battery curve are 0 to 100")
    return tuple(points)
