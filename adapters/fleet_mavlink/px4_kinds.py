"""Kinds of PX4 vehicles: all have the modes of its multirotors, and the same braking command."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from fleet_mavlink.constants import CUSTOM_MODE, NAN, MavCmd
from fleet_mavlink.messages import CommandLong, EstimatorStatus
from fleet_mavlink.payload_messages import HighresImu
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle_kind import Brake, VehicleKind

_CHANGE_MODE = 1.0  # param2 of DO_REPOSITION
_HOLD = "AUTO.LOITER"


class Px4Kind(VehicleKind):
    """Common part of all PX4 vehicles; as it is, a vehicle on ground or water."""

    name: ClassVar[str] = "px4"
    modes: ClassVar[Mapping[int, str]] = {
        0x00010000: "MANUAL",
        0x00020000: "ALTCTL",
        0x00030000: "POSCTL",
        0x01030000: "ORBIT",
        0x02030000: "POSCTL_SLOW",
        0x00050000: "ACRO",
        0x00060000: "OFFBOARD",
        0x00070000: "STABILIZED",
        0x000A0000: "TERMINATION",
        0x01040000: "AUTO.READY",
        0x02040000: "AUTO.TAKEOFF",
        0x03040000: "AUTO.LOITER",
        0x04040000: "AUTO.MISSION",
        0x05040000: "AUTO.RTL",
        0x06040000: "AUTO.LAND",
        0x08040000: "AUTO.FOLLOW_TARGET",
        0x09040000: "AUTO.PRECLAND",
        0x0A040000: "AUTO.VTOL_TAKEOFF",
    }
    rates: ClassVar[Mapping[int, float]] = {EstimatorStatus.message_id: 1.0}
    imu: ClassVar[int | None] = HighresImu.message_id
    motors: ClassVar[int | None] = None  # its motor messages contain no speeds
    bytewise_parameters: ClassVar[bool] = True
    data_streams: ClassVar[tuple[int, ...]] = ()
    may_be_disarmed: ClassVar[bool] = True

    def mode_command(self, mode: str) -> CommandLong:
        """Return DO_SET_MODE with the main mode and the sub mode."""
        number = self.number_of(mode)
        return CommandLong(
            MavCmd.DO_SET_MODE,
            param1=CUSTOM_MODE,
            param2=float(number >> 16 & 0xFF),
            param3=float(number >> 24 & 0xFF),
        )

    def hold_command(self, state: VehicleState) -> CommandLong:  # noqa: ARG002 - independent of the state
        """Return DO_REPOSITION without a position: it also ends a flight to a position, in the same mode."""
        return CommandLong(
            MavCmd.DO_REPOSITION,
            param1=-1.0,
            param2=_CHANGE_MODE,
            param4=NAN,
            param5=NAN,
            param6=NAN,
            param7=NAN,
        )

    def brakes(self, state: VehicleState) -> tuple[Brake, ...]:
        """Return the hold at the present position."""
        return (Brake(_HOLD, self.hold_command(state)),)

    def position_usable(self, state: VehicleState, now: float) -> bool | None:
        """Return True while positions arrive with good flags: PX4 reports lost positions, too."""
        return state.knows_where(now)

    def ready_to_arm(self, state: VehicleState) -> bool | None:
        """Return the arming check, once home is known."""
        return None if state.prearm_ok is None else state.prearm_ok and state.home is not None
