"""What may be written to the drives, in every cycle, whatever the body wants."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from fleet_quadruped.body.sense import Targets
from fleet_quadruped.robot.description import Joint
from fleet_quadruped.robot.names import Twelve
from fleet_quadruped.robot.parts import Safety

_SAME = 1e-9  # rad


class Limited(NamedTuple):
    """Targets that are safe to write, and how many numbers had to be changed."""

    targets: Targets
    clamped: int


def limit(
    wanted: Targets, last: Twelve, measured: Twelve, joints: Sequence[Joint], safety: Safety, *, dt: float
) -> Limited:
    """Return targets within limits: position, step, speed, distance to the measured angle, torque.

    Not-a-number keeps the last target. The limits of position are applied last and always hold.
    """
    clamped = 0
    targets: list[tuple[float, float, float]] = []
    for angle, speed, torque, before, actual, joint in zip(*wanted, last, measured, joints, strict=True):
        kind = joint.kind
        safe = safe_angle(angle, before, actual, joint, safety, dt=dt)
        clamped += not -_SAME < safe - angle < _SAME
        targets.append((safe, _within(speed, kind.velocity), _within(torque, kind.torque)))
    return Limited(Targets(*zip(*targets, strict=True)), clamped)


def safe_angle(
    wanted: float, last: float, measured: float, joint: Joint, safety: Safety, *, dt: float
) -> float:
    """Return the angle nearest to ``wanted`` that one joint may be sent to, rad."""
    step, following = min(safety.step, joint.kind.velocity * dt), safety.following
    low, high = joint.low + safety.margin, joint.high - safety.margin
    near = -step <= wanted - last <= step and -following <= wanted - measured <= following
    if near and low <= wanted <= high:
        return wanted  # as it nearly always is
    angle = wanted if math.isfinite(wanted) else last
    angle = _between(angle, last - step, last + step)
    angle = _between(angle, measured - following, measured + following)
    return _between(angle, low, high)


def _between(value: float, low: float, high: float) -> float:
    """Return the value, or the bound that it is beyond."""
    return low if value < low else high if value > high else value  # noqa: FURB136 - thrice as fast as min, max


def _within(value: float, most: float) -> float:
    """Return a finite value between -most and most; 0 for what is no number."""
    if -most <= value <= most:
        return value
    return _between(value, -most, most) if math.isfinite(value) else 0.0
