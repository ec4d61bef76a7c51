"""Missions of ArduRover: RTL is an item like others, and at the end it stands in AUTO."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, ClassVar

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.message_output import INFO
from fleet_mavlink.sim.mission_flight import MissionManoeuvre
from fleet_mavlink.sim.physics import MotionTarget
from fleet_mavlink.sim.rover_moves import BRAKED, Coast, DriveToPosition

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot
    from fleet_mavlink.sim.manoeuvres import Manoeuvre
    from fleet_mavlink.sim.mission_items import Item


def _roll(pilot: Autopilot, item: Item) -> Manoeuvre:
    north, east, _ = pilot.frame.ned_of(item.x / 1e7, item.y / 1e7, 0.0)
    return DriveToPosition(north, east)


def _home(pilot: Autopilot, _item: Item) -> Manoeuvre:
    north, east, _ = pilot.home.ned()
    return DriveToPosition(north, east)


def _stay(_pilot: Autopilot, _item: Item) -> Manoeuvre:
    return Coast(BRAKED)


class DriveMission(MissionManoeuvre):
    """Drive the items from the current one on."""

    manoeuvres: ClassVar[Mapping[int, Callable[[Autopilot, Item], Manoeuvre]]] = {
        mav.MAV_CMD_NAV_WAYPOINT: _roll,
        mav.MAV_CMD_NAV_LOITER_UNLIM: _roll,
        mav.MAV_CMD_NAV_LOITER_TIME: _roll,
        mav.MAV_CMD_NAV_RETURN_TO_LAUNCH: _home,
        mav.MAV_CMD_NAV_DELAY: _stay,
    }

    def __init__(self, pilot: Autopilot) -> None:
        super().__init__(pilot)
        self._leg = Coast(BRAKED)

    def aim(self, pilot: Autopilot) -> MotionTarget:
        """Return the drive of the item; report once that there is none left."""
        before = self.done
        wanted = super().aim(pilot)
        if self.done and not before:
            pilot.say(INFO, "Mission Complete")
            self._leg = Coast(BRAKED)
        return wanted
