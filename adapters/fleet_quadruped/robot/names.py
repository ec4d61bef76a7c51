"""The order of legs and joints that every tuple of twelve in this package has."""

from __future__ import annotations

from typing import Literal

Leg = Literal["FL", "FR", "RL", "RR"]
Part = Literal["abad", "hip", "knee"]
GaitName = Literal["trot", "walk"]

LEGS: tuple[Leg, ...] = ("FL", "FR", "RL", "RR")
PARTS: tuple[Part, ...] = ("abad", "hip", "knee")
JOINTS: tuple[str, ...] = tuple(f"{leg}_{part}" for leg in LEGS for part in PARTS)

Twelve = tuple[float, ...]
"""One number a joint, in the order of ``JOINTS``."""
