"""Detects that a robot is commanded but makes no progress. Pure."""

from __future__ import annotations

from fleet.model.geometry import Pose, Velocity, wrap_angle

REQUESTED_SPEED = 0.04  # m/s
REQUESTED_TURN = 0.15  # rad/s
MOVED = 0.03  # m that count as progress
TURNED = 0.087  # rad
STUCK_AFTER = 3.0  # s without either
NEARER = 0.05  # m
NOT_NEARER_AFTER = 5.0  # s of driving without coming nearer


class StuckDetector:
    """Detector for one action; ``now`` is monotonic seconds."""

    def __init__(self) -> None:
        self._anchor: Pose | None = None
        self._since = 0.0
        self._nearest = float("inf")
        self._nearer_at = 0.0

    def reset(self) -> None:
        """Start again."""
        self._anchor = None
        self._nearest = float("inf")

    def update(self, pose: Pose, requested: Velocity, remaining: float, now: float) -> bool:
        """Return True when the robot is stuck; ``remaining``: metres of the whole path."""
        drives = requested.linear.horizontal() >= REQUESTED_SPEED
        if not drives and abs(requested.yaw_rate) < REQUESTED_TURN:
            self.reset()
            return False
        if self._anchor is None or _moved(self._anchor, pose):
            self._anchor, self._since = pose, now
        if not drives or remaining < self._nearest - NEARER:
            self._nearest, self._nearer_at = min(remaining, self._nearest), now
        return now - self._since > STUCK_AFTER or now - self._nearer_at > NOT_NEARER_AFTER


def _moved(one: Pose, other: Pose) -> bool:
    """Return True when two poses differ enough."""
    turned = abs(wrap_angle(other.rotation.yaw - one.rotation.yaw))
    return (other.position - one.position).horizontal() > MOVED or turned > TURNED
