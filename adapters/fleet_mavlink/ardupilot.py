"""ArduCopter: mode numbers and behaviour as observed on the wire of version 4.6."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from fleet import GeoPoint, Refused
from fleet_mavlink.ardupilot_kinds import ArduPilotKind
from fleet_mavlink.constants import AUTOPILOT, MAG_CAL_SUCCESS, Cmd, Frame
from fleet_mavlink.flavour import CalibrationStep, Flavour
from fleet_mavlink.messages import CommandLong, MavlinkMessage, SetPositionTargetGlobalInt
from fleet_mavlink.payload_messages import MagCalProgress, MagCalReport
from fleet_mavlink.texts import Sentence

_GROUND_SPEED = 1.0  # param1 of DO_CHANGE_SPEED
_PLACE_AND_YAW = 0x9F8  # type_mask: ignore everything except position and yaw


class ArduCopter(ArduPilotKind, Flavour):
    """ArduPilot for multirotors. Held by BRAKE: LOITER without a pilot's stick would descend."""

    modes: ClassVar[Mapping[int, str]] = {
        0: "STABILIZE",
        1: "ACRO",
        2: "ALT_HOLD",
        3: "AUTO",
        4: "GUIDED",
        5: "LOITER",
        6: "RTL",
        7: "CIRCLE",
        9: "LAND",
        11: "DRIFT",
        13: "SPORT",
        14: "FLIP",
        15: "AUTOTUNE",
        16: "POSHOLD",
        17: "BRAKE",
        18: "THROW",
        19: "AVOID_ADSB",
        20: "GUIDED_NOGPS",
        21: "SMART_RTL",
        22: "FLOWHOLD",
        23: "FOLLOW",
        24: "ZIGZAG",
        25: "SYSTEMID",
        26: "AUTOROTATE",
        27: "AUTO_RTL",
    }
    external: ClassVar[str] = "GUIDED"
    hold: ClassVar[str] = "BRAKE"
    goto: ClassVar[str] = "GUIDED"
    land: ClassVar[str] = "LAND"
    return_home: ClassVar[str] = "RTL"
    arming: ClassVar[str] = "GUIDED"
    takeoff: ClassVar[str] = "GUIDED"
    takes_off_in_air: ClassVar[bool] = False
    takeoff_tolerance: ClassVar[str | None] = None
    mission: ClassVar[str] = "AUTO"
    home_is_first: ClassVar[bool] = True
    rewind: ClassVar[CommandLong | None] = CommandLong(Cmd.DO_SET_MISSION_CURRENT)
    repeats_reached: ClassVar[bool] = False
    unset: ClassVar[float] = 0.0
    lead_in: ClassVar[float] = 0.0
    follows: ClassVar[Mapping[str, frozenset[str]]] = {}
    compass_start: ClassVar[CommandLong] = CommandLong(Cmd.DO_START_MAG_CAL, param3=1.0)  # saved by itself
    compass_stop: ClassVar[CommandLong] = CommandLong(Cmd.DO_CANCEL_MAG_CAL)
    braking: ClassVar[tuple[str, ...]] = ("BRAKE",)

    def hold_command(self) -> CommandLong:
        """Return the change to BRAKE."""
        return self.mode_command(self.hold)

    def takeoff_command(self, altitude: float, home_altitude: float) -> CommandLong:  # noqa: ARG002
        """Return NAV_TAKEOFF, whose altitude is above home."""
        return CommandLong(Cmd.NAV_TAKEOFF, param7=altitude)

    def go_command(
        self,
        to: GeoPoint,
        home_altitude: float,
        speed: float,  # noqa: ARG002 - it takes none here: ``after_go``
        heading: float,
    ) -> SetPositionTargetGlobalInt:
        """Return the target with the altitude above home.

        DO_REPOSITION takes no heading: the nose would turn as WP_YAW_BEHAVIOR says.
        """
        return SetPositionTargetGlobalInt(
            target_system=0,
            target_component=AUTOPILOT,
            coordinate_frame=Frame.GLOBAL_RELATIVE_ALT_INT,
            type_mask=_PLACE_AND_YAW,
            lat_int=round(to.latitude * 1e7),
            lon_int=round(to.longitude * 1e7),
            alt=to.altitude - home_altitude,
            yaw=heading,
        )

    def after_go(self, speed: float) -> CommandLong | None:
        """Return DO_CHANGE_SPEED. It must follow the target: a new target resets the speed."""
        return CommandLong(Cmd.DO_CHANGE_SPEED, param1=_GROUND_SPEED, param2=speed, param3=-1.0)

    def calibration_step(self, said: MavlinkMessage | Sentence) -> CalibrationStep | None:
        """Read MAG_CAL_PROGRESS and MAG_CAL_REPORT, which come once per compass."""
        if not isinstance(said, MagCalProgress | MagCalReport):
            return None
        others = frozenset(each for each in range(8) if said.cal_mask >> each & 1) | {said.compass_id}
        if isinstance(said, MagCalProgress):
            return CalibrationStep(min(99.0, said.completion_pct), said.compass_id, others)
        if said.cal_status != MAG_CAL_SUCCESS:
            why = f"compass {said.compass_id}: status {said.cal_status}, fitness {said.fitness:.1f}"
            raise Refused(f"the calibration failed ({why})", hint="away from metal, all axes")
        return CalibrationStep(100.0, said.compass_id, others)
