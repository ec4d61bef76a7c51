"""Missions of VTOLs: like planes, but NAV_VTOL_LAND lands with the rotors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, ClassVar

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.manoeuvres import GoToManoeuvre, Land, Manoeuvre
from fleet_mavlink.sim.mission_flight import LandThere, MissionManoeuvre, place_of_item
from fleet_mavlink.sim.physics import MotionTarget
from fleet_mavlink.sim.plane_mission import WingedMission
from fleet_mavlink.sim.plane_moves import FlyOver

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot
    from fleet_mavlink.sim.mission_items import Item


class _LandByRotors(Manoeuvre):
    """Fly near the position on its wings, hover to it at the same height, and descend."""

    def __init__(self, pilot: Autopilot, item: Item) -> None:
        north, east, _ = place_of_item(pilot, item)
        self._leg: Manoeuvre = FlyOver(north, east, pilot.body.down, pilot.slows_within)  # type: ignore[attr-defined]
        self._above = GoToManoeuvre(north, east, pilot.body.down)

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the motion of the present leg."""
        if self._leg.done and isinstance(self._leg, FlyOver):
            self._leg = self._above
            pilot.hover()  # type: ignore[attr-defined]
        elif self._leg.done and self._leg is self._above:
            self._leg = Land(pilot)
        self.in_air_state = self._leg.in_air_state
        wanted = self._leg.aim(pilot)
        self.done = self._leg.done and isinstance(self._leg, Land)
        return wanted


class VtolMission(WingedMission):
    """Fly the items from the current one on, on its wings."""

    manoeuvres: ClassVar[Mapping[int, Callable[[Autopilot, Item], Manoeuvre]]] = {
        **WingedMission.manoeuvres,
        mav.MAV_CMD_NAV_VTOL_LAND: _LandByRotors,
    }


class HoverMission(MissionManoeuvre):
    """Fly the items from the current one on, in hover."""

    manoeuvres: ClassVar[Mapping[int, Callable[[Autopilot, Item], Manoeuvre]]] = {
        **MissionManoeuvre.manoeuvres,
        mav.MAV_CMD_NAV_VTOL_LAND: LandThere,
    }
