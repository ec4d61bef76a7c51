"""ArduRover, on wheels or afloat: mode numbers and behaviour of version 4.6, as observed on the wire."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from fleet import GeoPoint, Refused, Velocity
from fleet_mavlink.ardupilot_flavour import ArduPilotFlavour
from fleet_mavlink.constants import AUTOPILOT, NAN, MavCmd, MavFrame, mode_names
from fleet_mavlink.flavour import VELOCITY_AND_YAW_RATE
from fleet_mavlink.messages import CommandInt, CommandLong, SetPositionTargetLocalNed
from fleet_mavlink.vocabulary import SURFACE

_CHANGE_MODE = 1.0  # param2 of DO_REPOSITION
_STILL = 0.01  # m/s


class ArduRover(ArduPilotFlavour):
    """A rover. HOLD takes the drive away and needs no position; the rover coasts."""

    modes: ClassVar[Mapping[int, str]] = mode_names("ROVER_MODE", {16: "INITIALISING"})
    braking: ClassVar[tuple[str, ...]] = ("HOLD",)
    may_be_disarmed: ClassVar[bool] = True
    hold: ClassVar[str] = "HOLD"
    land: ClassVar[str] = ""  # none
    surface: ClassVar[bool] = True
    rest: ClassVar[float] = 4.0  # zero velocity brakes it, HOLD lets it coast
    tolerance: ClassVar[float] = 1.5  # m; observed to stop within 0.7 m of a position, after a sharp turn
    lacking: ClassVar[Mapping[str, str]] = SURFACE

    @property
    def failsafe_table(self) -> str:
        """Table of fail-safe parameters of rovers."""
        return "ardurover"

    def takeoff_command(self, altitude: float, home_altitude: float) -> CommandLong:  # noqa: ARG002 - it cannot
        """Raise Refused: it does not take off."""
        raise Refused(self.lacking["takeoff"])

    def cannot(self, velocity: Velocity, *, turns_in_place: bool | None) -> str:
        """Return why it cannot move sideways or vertically: ArduRover would turn there and drive on."""
        if abs(velocity.linear.y) > _STILL:
            return self.lacking["strafe_left"]
        stands = abs(velocity.linear.x) <= _STILL and abs(velocity.yaw_rate) > _STILL
        if stands and turns_in_place is False:
            return "it is steered by its wheels or its rudder: it turns only while it drives"
        return self.lacking["ascend"] if abs(velocity.linear.z) > _STILL else ""

    def setpoint(
        self,
        velocity: Velocity,
        heading: float,  # noqa: ARG002 - body frame
        system: int,
    ) -> SetPositionTargetLocalNed:
        """Return the setpoint in the body frame: speed along the nose, and yaw rate.

        The yaw rate must be set: only then a negative speed drives backwards. Without it, ArduRover turns
        without end. In another frame the sign of x would decide, whatever the heading is.
        """
        return SetPositionTargetLocalNed(
            target_system=system,
            target_component=AUTOPILOT,
            coordinate_frame=MavFrame.BODY_NED,
            type_mask=VELOCITY_AND_YAW_RATE,
            vx=velocity.linear.x,
            vy=0.0,
            vz=0.0,
            yaw_rate=-velocity.yaw_rate,
        )

    def command_before_go(self, *, backwards: bool) -> CommandLong | None:
        """Return DO_SET_REVERSE, each time: ArduRover keeps it until its mode changes."""
        return CommandLong(MavCmd.DO_SET_REVERSE, param1=float(backwards))

    def go_command(
        self,
        to: GeoPoint,
        home_altitude: float,  # noqa: ARG002 - it has no height
        speed: float,  # noqa: ARG002 - refused without a target: see ``command_after_go``
        heading: float,  # noqa: ARG002 - its nose follows its course
    ) -> CommandInt:
        """Return DO_REPOSITION, which is acknowledged."""
        return CommandInt(
            MavCmd.DO_REPOSITION,
            frame=MavFrame.GLOBAL_RELATIVE_ALT_INT,
            param1=-1.0,
            param2=_CHANGE_MODE,
            param4=NAN,
            x=round(to.latitude * 1e7),
            y=round(to.longitude * 1e7),
        )


class ArduBoat(ArduRover):
    """A boat: it would drift in HOLD, so it holds its position if that is known."""

    braking: ClassVar[tuple[str, ...]] = ("LOITER", "HOLD")
    hold: ClassVar[str] = "LOITER"
