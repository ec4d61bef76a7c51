"""Common part of the ArduPilot 4.6 vehicles that this adapter moves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from fleet import Refused
from fleet_mavlink.ardupilot_kinds import ArduPilotKind
from fleet_mavlink.constants import MAG_CAL_SUCCESS, MavCmd
from fleet_mavlink.flavour import CalibrationStep, Flavour
from fleet_mavlink.messages import CommandLong, MavlinkCommand, MavlinkMessage
from fleet_mavlink.payload_messages import MagCalProgress, MagCalReport
from fleet_mavlink.state import VehicleState
from fleet_mavlink.statustext import Sentence

_GROUND_SPEED = 1.0  # param1 of DO_CHANGE_SPEED


class ArduPilotFlavour(ArduPilotKind, Flavour):
    """An ArduPilot vehicle that moves in GUIDED, both by setpoints and to positions."""

    external: ClassVar[str] = "GUIDED"
    goto: ClassVar[str] = "GUIDED"
    return_home: ClassVar[str] = "RTL"
    arming: ClassVar[str] = "GUIDED"
    takeoff: ClassVar[str] = "GUIDED"
    takes_off_in_air: ClassVar[bool] = False
    takeoff_tolerance: ClassVar[str | None] = None
    mission: ClassVar[str] = "AUTO"
    home_is_first: ClassVar[bool] = True
    rewind: ClassVar[CommandLong | None] = CommandLong(MavCmd.DO_SET_MISSION_CURRENT)
    repeats_reached: ClassVar[bool] = False
    unset: ClassVar[float] = 0.0
    lead_in: ClassVar[float] = 0.0
    follows: ClassVar[Mapping[str, frozenset[str]]] = {}
    compass_start: ClassVar[CommandLong] = CommandLong(MavCmd.DO_START_MAG_CAL, param3=1.0)  # saved by itself
    compass_stop: ClassVar[CommandLong] = CommandLong(MavCmd.DO_CANCEL_MAG_CAL)

    def hold_command(self, state: VehicleState) -> MavlinkCommand:  # noqa: ARG002 - independent of the state
        """Return the change to the holding mode."""
        return self.mode_command(self.hold)

    def command_after_go(self, speed: float, state: VehicleState) -> CommandLong | None:  # noqa: ARG002
        """Return DO_CHANGE_SPEED. It must follow the position: a new position resets the speed."""
        return CommandLong(MavCmd.DO_CHANGE_SPEED, param1=_GROUND_SPEED, param2=speed, param3=-1.0)

    def calibration_step(self, said: MavlinkMessage | Sentence) -> CalibrationStep | None:
        """Interpret MAG_CAL_PROGRESS and MAG_CAL_REPORT, which are sent once per compass."""
        if not isinstance(said, MagCalProgress | MagCalReport):
            return None
        others = frozenset(each for each in range(8) if said.cal_mask >> each & 1) | {said.compass_id}
        if isinstance(said, MagCalProgress):
            return CalibrationStep(min(99.0, said.completion_pct), said.compass_id, others)
        if said.cal_status != MAG_CAL_SUCCESS:
            why = f"compass {said.compass_id}: status {said.cal_status}, fitness {said.fitness:.1f}"
            raise Refused(f"the calibration failed ({why})", hint="away from metal, all axes")
        return CalibrationStep(100.0, said.compass_id, others)
