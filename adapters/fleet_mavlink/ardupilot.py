"""ArduCopter: mode numbers and behaviour of version 4.6, as observed on the wire."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from fleet import GeoPoint
from fleet_mavlink.ardupilot_flavour import ArduPilotFlavour
from fleet_mavlink.constants import AUTOPILOT, MavCmd, MavFrame, mode_names
from fleet_mavlink.messages import CommandLong, SetPositionTargetGlobalInt

_PLACE_AND_YAW = 0x9F8  # type_mask: ignore everything except position and yaw


class ArduCopter(ArduPilotFlavour):
    """ArduPilot for multirotors. Holds in BRAKE: without a pilot's stick, LOITER would descend."""

    modes: ClassVar[Mapping[int, str]] = mode_names("COPTER_MODE")
    hold: ClassVar[str] = "BRAKE"
    land: ClassVar[str] = "LAND"
    braking: ClassVar[tuple[str, ...]] = ("BRAKE",)

    def takeoff_command(self, altitude: float, home_altitude: float) -> CommandLong:  # noqa: ARG002
        """Return NAV_TAKEOFF, whose altitude is above home."""
        return CommandLong(MavCmd.NAV_TAKEOFF, param7=altitude)

    def go_command(
        self,
        to: GeoPoint,
        home_altitude: float,
        speed: float,  # noqa: ARG002 - see ``command_after_go``
        heading: float,
    ) -> SetPositionTargetGlobalInt:
        """Return the target with its altitude above home.

        DO_REPOSITION has no heading: the nose would turn as WP_YAW_BEHAVIOR defines.
        """
        return SetPositionTargetGlobalInt(
            target_system=0,
            target_component=AUTOPILOT,
            coordinate_frame=MavFrame.GLOBAL_RELATIVE_ALT_INT,
            type_mask=_PLACE_AND_YAW,
            lat_int=round(to.latitude * 1e7),
            lon_int=round(to.longitude * 1e7),
            alt=to.altitude - home_altitude,
            yaw=heading,
        )
