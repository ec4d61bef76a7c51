"""Names and order of legs and joints; every tuple of twelve in this package has this order."""

from __future__ import annotations

from typing import Literal

LegName = Literal["FL", "FR", "RL", "RR"]
Part = Literal["abad", "hip", "knee"]
GaitName = Literal["trot", "walk"]

LEGS: tuple[LegName, ...] = ("FL", "FR", "RL", "RR")
PARTS: tuple[Part, ...] = ("abad", "hip", "knee")
JOINTS: tuple[str, ...] = tuple(f"{leg}_{part}" for leg in LEGS for part in PARTS)

QUATERNION = frozenset({"qw", "qx", "qy", "qz"})
EULER = frozenset({"roll", "pitch", "yaw"})
RATES = frozenset({"gx", "gy", "gz"})
"""Names in frames: attitude of the IMU (a quaternion, or angles in rad) and angular rates, rad/s."""

Twelve = tuple[float, ...]
"""One number per joint, in the order of ``JOINTS``."""
