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
    angles: list[float] = []
    for angle, before, actual, joint in zip(wanted.angles, last, measured, joints, strict=True):
        safe = safe_angle(angle, before, actual, joint, safety, dt=dt)
        clamped += not -_SAME < safe - angle < _SAME
        angles.append(safe)
    speeds = [_within(speed, joint.kind.velocity) for speed, joint in zip(wanted.speeds, joints, strict=True)]
    torques = [
        _within(torque, joint.kind.torque) for torque, joint in zip(wanted.torques, joints, strict=True)
    ]
    return Limited(Targets(tuple(angles), tuple(speeds), tuple(torques)), clamped)


def safe_angle(
    wanted: float, last: float, measured: float, joint: Joint, safety: Safety, *, dt: float
) -> float:
    """Return the angle nearest to ``wanted`` that one joint may be sent to, rad."""
    angle = wanted if math.isfinite(wanted) else last
    step = min(safety.step, joint.kind.velocity * dt)
    angle = _between(angle, last - step, last + step)
    angle = _between(angle, measured - safety.following, measured + safety.following)
    return _between(angle, joint.low + safety.margin, joint.high - safety.margin)


def _between(value: float, low: float, high: float) -> float:
    """Return the value, or the bound that it is beyond."""
    return low if value < low else high if value > high else value  # noqa: FURB136 - thrice as fast as min, max


def _within(value: float, most: float) -> float:
    """Return a finite value between -most and most; 0 for what is no number."""
    return _between(value, -most, most) if math.isfinite(value) else 0.0
