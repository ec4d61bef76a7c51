"""Joints that take targets: how far and how fast each may go."""

from __future__ import annotations

import msgspec


class JointRange(msgspec.Struct, frozen=True):
    """One joint that takes targets: from ``least`` to ``most`` (rad, or m) at ``speed`` (rad/s, or m/s)."""

    least: float
    most: float
    speed: float

    def __str__(self) -> str:
        return f"{self.least:.3g} to {self.most:.3g}"
