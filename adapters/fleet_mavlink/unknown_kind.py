"""Kind of a vehicle whose autopilot or type is not known here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from fleet_mavlink.constants import MavCmd
from fleet_mavlink.messages import CommandLong
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle_kind import Brake, VehicleKind


class UnknownKind(VehicleKind):
    """Unknown vehicle without mode names. A stop requests a pause, and fails unless it is seen to stand."""

    name: ClassVar[str] = "an unknown autopilot"
    modes: ClassVar[Mapping[int, str]] = {}
    rates: ClassVar[Mapping[int, float]] = {}
    imu: ClassVar[int | None] = None
    motors: ClassVar[int | None] = None
    data_streams: ClassVar[tuple[int, ...]] = ()
    bytewise_parameters: ClassVar[bool] = False

    def brakes(self, state: VehicleState) -> tuple[Brake, ...]:  # noqa: ARG002 - always the same
        """Return DO_PAUSE_CONTINUE, which shows no mode: its effect must be seen."""
        return (Brake("", CommandLong(MavCmd.DO_PAUSE_CONTINUE)),)

    def position_usable(self, state: VehicleState, now: float) -> bool | None:
        """Return True while positions arrive."""
        return state.knows_where(now)

    def ready_to_arm(self, state: VehicleState) -> bool | None:
        """Return the arming check."""
        return state.prearm_ok
