"""PX4 for multirotors: mode numbers and behaviour of version 1.16, as observed on the wire."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import ClassVar

from fleet import GeoPoint, Refused
from fleet_mavlink.constants import NAN, MavCmd, MavFrame
from fleet_mavlink.flavour import CalibrationStep, Flavour
from fleet_mavlink.messages import CommandInt, CommandLong, MavlinkMessage
from fleet_mavlink.px4_kinds import Px4Kind
from fleet_mavlink.state import VehicleState
from fleet_mavlink.statustext import Sentence

_CHANGE_MODE = 1.0  # param2 of DO_REPOSITION
_CAL = "[cal] "  # prefix of its texts about a calibration
_PROGRESS = re.compile(r"progress <(\d{1,3})>")


class Px4(Px4Kind, Flavour):
    """PX4 for multirotors. Altitudes on its wire are above mean sea level, whatever the frame."""

    external: ClassVar[str] = "OFFBOARD"
    hold: ClassVar[str] = "AUTO.LOITER"
    goto: ClassVar[str] = "AUTO.LOITER"
    land: ClassVar[str] = "AUTO.LAND"
    return_home: ClassVar[str] = "AUTO.RTL"
    arming: ClassVar[str] = "AUTO.LOITER"
    takeoff: ClassVar[str] = "AUTO.TAKEOFF"
    takes_off_in_air: ClassVar[bool] = True
    takeoff_tolerance: ClassVar[str | None] = "NAV_MC_ALT_RAD"
    mission: ClassVar[str] = "AUTO.MISSION"
    home_is_first: ClassVar[bool] = False
    rewind: ClassVar[CommandLong | None] = None
    checks_mission: ClassVar[float] = 2.0
    repeats_reached: ClassVar[bool] = True
    unset: ClassVar[float] = NAN
    lead_in: ClassVar[float] = 0.3
    follows: ClassVar[Mapping[str, frozenset[str]]] = {"AUTO.TAKEOFF": frozenset({"AUTO.LOITER"})}
    may_be_disarmed: ClassVar[bool] = False
    compass_start: ClassVar[CommandLong] = CommandLong(MavCmd.PREFLIGHT_CALIBRATION, param2=1.0)
    compass_stop: ClassVar[CommandLong] = CommandLong(MavCmd.PREFLIGHT_CALIBRATION)

    def takeoff_command(self, altitude: float, home_altitude: float) -> CommandLong:
        """Return NAV_TAKEOFF at its present position; a position of 0, 0 would be taken literally."""
        return CommandLong(
            MavCmd.NAV_TAKEOFF, param4=NAN, param5=NAN, param6=NAN, param7=home_altitude + altitude
        )

    def go_command(
        self,
        to: GeoPoint,
        home_altitude: float,  # noqa: ARG002 - it takes AMSL
        speed: float,
        heading: float,
    ) -> CommandInt:
        """Return DO_REPOSITION; as COMMAND_INT, because a float cannot represent a longitude to the metre.

        Without a heading the nose would turn as MPC_YAW_MODE defines.
        """
        return CommandInt(
            MavCmd.DO_REPOSITION,
            frame=MavFrame.GLOBAL_INT,
            param1=speed,
            param2=_CHANGE_MODE,
            param4=heading,
            x=round(to.latitude * 1e7),
            y=round(to.longitude * 1e7),
            z=to.altitude,
        )

    def command_after_go(self, speed: float, state: VehicleState) -> CommandLong | None:  # noqa: ARG002
        """Return None: the go command has the speed."""
        return None

    def calibration_step(self, said: MavlinkMessage | Sentence) -> CalibrationStep | None:
        """Interpret its texts, which begin with ``[cal]``."""
        if not isinstance(said, Sentence) or not said.text.startswith(_CAL):
            return None
        words = said.text.removeprefix(_CAL)
        if words.startswith(("calibration failed", "calibration cancelled")):
            raise Refused(words)
        if words.startswith("calibration done"):
            return CalibrationStep(100.0)
        percent = _PROGRESS.fullmatch(words)
        return CalibrationStep(min(99.0, float(percent[1]))) if percent else None
