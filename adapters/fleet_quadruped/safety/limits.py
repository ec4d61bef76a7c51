"""Limits of the targets written to the drives, applied in every cycle."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec

from fleet_quadruped.body.measured import Targets
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.names import Twelve
from fleet_quadruped.robot.parts import Safety

_SAME = 1e-9  # rad


class Limited(msgspec.Struct, frozen=True, gc=False):
    """Targets that are safe to write, and the number of clamped values."""

    targets: Targets
    clamped: int


class JointLimits:
    """Limits of the joints: positions minus the margin, speeds, torques."""

    def __init__(self, joints: Sequence[Joint], safety: Safety) -> None:
        self._safety = safety
        self._places = [
            (joint.low + safety.margin, joint.high - safety.margin, joint.kind.velocity) for joint in joints
        ]
        self._velocities = [joint.kind.velocity for joint in joints]
        self._torques = [joint.kind.torque for joint in joints]

    def limit(self, wanted: Targets, last: Twelve, measured: Twelve, dt: float) -> Limited:
        """Return targets within limits: position, step, speed, distance to the measured angle, torque.

        NaN keeps the last target. The position limits are applied last and always hold.
        """
        clamped, longest, following = 0, self._safety.step, self._safety.following
        angles: list[float] = []
        for angle, before, actual, (low, high, velocity) in zip(
            wanted.angles, last, measured, self._places, strict=True
        ):
            step = velocity * dt
            step = longest if longest < step else step  # noqa: FURB136 - quicker than min
            near = -step <= angle - before <= step and -following <= angle - actual <= following
            if near and low <= angle <= high:
                angles.append(angle)  # the common case
                continue
            safe = angle if math.isfinite(angle) else before
            safe = _between(safe, before - step, before + step)
            safe = _between(safe, actual - following, actual + following)
            safe = _between(safe, low, high)
            clamped += not -_SAME < safe - angle < _SAME
            angles.append(safe)
        speeds, torques = _within(wanted.speeds, self._velocities), _within(wanted.torques, self._torques)
        return Limited(Targets(tuple(angles), speeds, torques), clamped)


def _between(value: float, low: float, high: float) -> float:
    """Clamp a value; NaN bounds have no effect."""
    return low if value < low else high if value > high else value  # noqa: FURB136 - NaN bounds


def _within(values: Twelve, limits: Sequence[float]) -> Twelve:
    """Clamp values to plus or minus their limits; 0 for values that are not finite."""
    return tuple(
        [
            value if -most <= value <= most else _between(value, -most, most) if math.isfinite(value) else 0.0
            for value, most in zip(values, limits, strict=True)
        ]
    )
