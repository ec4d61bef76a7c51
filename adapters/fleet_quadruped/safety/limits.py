"""What may be written to the drives, in every cycle, whatever the body wants."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from fleet_quadruped.body.sense import Targets
from fleet_quadruped.robot.description import Joint
from fleet_quadruped.robot.names import Twelve
from fleet_quadruped.robot.parts import Safety


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
    speeds: list[float] = []
    torques: list[float] = []
    for number, joint in enumerate(joints):
        kind = joint.kind
        angle = safe_angle(wanted.angles[number], last[number], measured[number], joint, safety, dt=dt)
        speed = _within(wanted.speeds[number], kind.velocity)
        torque = _within(wanted.torques[number], kind.torque)
        clamped += not math.isclose(angle, wanted.angles[number], abs_tol=1e-9)
        angles.append(angle)
        speeds.append(speed)
        torques.append(torque)
    return Limited(Targets(tuple(angles), tuple(speeds), tuple(torques)), clamped)


def safe_angle(
    wanted: float, last: float, measured: float, joint: Joint, safety: Safety, *, dt: float
) -> float:
    """Return the angle nearest to ``wanted`` that one joint may be sent to, rad."""
    angle = wanted if math.isfinite(wanted) else last
    step = min(safety.step, joint.kind.velocity * dt)
    angle = min(max(angle, last - step), last + step)
    angle = min(max(angle, measured - safety.following), measured + safety.following)
    return min(max(angle, joint.low + safety.margin), joint.high - safety.margin)


def _within(value: float, most: float) -> float:
    """Return a finite value between -most and most; 0 for what is no number."""
    return max(-most, min(most, value)) if math.isfinite(value) else 0.0
