"""Kinds of ArduPilot vehicles, also those that are only stopped: mode numbers of 4.6, braking modes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from fleet_mavlink.constants import CUSTOM_MODE, MavCmd, mode_names
from fleet_mavlink.messages import CommandLong, EkfStatusReport
from fleet_mavlink.payload_messages import EscTelemetry1To4, RawImu
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle_kind import Brake, VehicleKind


class ArduPilotKind(VehicleKind):
    """Common part of all ArduPilot vehicles."""

    name: ClassVar[str] = "ardupilot"
    rates: ClassVar[Mapping[int, float]] = {EkfStatusReport.message_id: 1.0}
    imu: ClassVar[int | None] = RawImu.message_id
    motors: ClassVar[int | None] = EscTelemetry1To4.message_id
    bytewise_parameters: ClassVar[bool] = False
    data_streams: ClassVar[tuple[int, ...]] = (2, 6, 10, 12)  # status, position, attitude, the rest
    braking: ClassVar[tuple[str, ...]]  # modes that brake it, the best one first

    def mode_command(self, mode: str) -> CommandLong:
        """Return DO_SET_MODE with the mode's number."""
        return CommandLong(MavCmd.DO_SET_MODE, param1=CUSTOM_MODE, param2=float(self.number_of(mode)))

    def brakes(self, state: VehicleState) -> tuple[Brake, ...]:  # noqa: ARG002 - QuadPlanes need it
        """Return the changes to the modes that brake it."""
        return tuple(Brake(mode, self.mode_command(mode)) for mode in self.braking)

    def position_usable(self, state: VehicleState, now: float) -> bool | None:  # noqa: ARG002 - from the flags
        """Return the estimator's own flags: home is known 20 s before the position is usable."""
        return state.estimator_has_position

    def ready_to_arm(self, state: VehicleState) -> bool | None:
        """Return True once the arming check passes with a usable position; the check alone is too early."""
        usable = self.position_usable(state, 0.0)
        return None if state.prearm_ok is None or usable is None else state.prearm_ok and usable


class ArduSub(ArduPilotKind):
    """An underwater vehicle: holds its position if known, else its depth."""

    modes: ClassVar[Mapping[int, str]] = mode_names("SUB_MODE", {20: "MOTOR_DETECT"})
    braking: ClassVar[tuple[str, ...]] = ("POSHOLD", "ALT_HOLD")
    may_be_disarmed: ClassVar[bool] = True


class ArduTracker(ArduPilotKind):
    """An antenna that tracks a vehicle."""

    modes: ClassVar[Mapping[int, str]] = mode_names("TRACKER_MODE", {16: "INITIALISING"})
    braking: ClassVar[tuple[str, ...]] = ("STOP",)
    may_be_disarmed: ClassVar[bool] = True


class ArduBlimp(ArduPilotKind):
    """An airship; LOITER needs a position; MANUAL without a pilot leaves its fins unchanged."""

    modes: ClassVar[Mapping[int, str]] = {0: "LAND", 1: "MANUAL", 2: "VELOCITY", 3: "LOITER", 4: "RTL"}
    braking: ClassVar[tuple[str, ...]] = ("LOITER", "LAND")
