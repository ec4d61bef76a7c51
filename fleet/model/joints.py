"""Position and speed limits of joints that accept targets."""

from __future__ import annotations

import msgspec


class JointRange(msgspec.Struct, frozen=True):
    """Limits of one joint: positions from ``least`` to ``most`` (rad, or m), ``speed`` (rad/s, or m/s)."""

    least: float
    most: float
    speed: float

    def __str__(self) -> str:
        return f"{self.least:.3g} to {self.most:.3g}"
