"""Conversion between a joint and a motor that reports its own angle in rad: sign, offset and ratio."""

from __future__ import annotations

from fleet_quadruped.robot.joint import Joint


class Units:
    """Conversion between a joint and its motor."""

    __slots__ = ("_ratio", "_zero")

    def __init__(self, joint: Joint) -> None:
        ratio = joint.kind.ratio
        self._zero = joint.offset * ratio
        self._ratio = joint.sign * ratio

    def motor(self, angle: float, speed: float, torque: float) -> tuple[float, float, float]:
        """Return angle, speed and torque of the motor from those of its joint."""
        ratio = self._ratio
        return ratio * angle + self._zero, ratio * speed, torque / ratio

    def joint(self, angle: float, speed: float, torque: float) -> tuple[float, float, float]:
        """Return angle, speed and torque of the joint from those of its motor."""
        ratio = self._ratio
        return (angle - self._zero) / ratio, speed / ratio, torque * ratio


def near(joint: Joint, here: float, target: float, most: float | None) -> float:
    """Return the target (rad) moved so close that the joint's stiffness exerts at most ``most`` N m."""
    if most is None or joint.kind.kp == 0:
        return target
    reach = most / joint.kind.kp
    return max(here - reach, min(here + reach, target))
