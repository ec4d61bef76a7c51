"""A flight mode as data: its number on the wire, its requirements, its manoeuvre."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot
    from fleet_mavlink.sim.manoeuvres import Manoeuvre

MANUAL_BASE = 81  # base_mode flags: custom, stabilised, manual input
GUIDED_BASE = 89  # the same and guided
AUTO_BASE = 29  # custom, auto, guided, stabilised


@dataclass(frozen=True, slots=True)
class FlightMode:
    """One mode. ``position``: it needs a position estimate; ``armable``: motors may be armed in it."""

    name: str
    custom: int
    enter: Callable[[Autopilot], Manoeuvre]
    base: int = AUTO_BASE
    position: bool = True
    armable: bool = True
