"""Differences between autopilots: modes as data, commands as small functions that build them."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import msgspec

from fleet import GeoPoint, Vector3, Velocity, rotate_to_world
from fleet_mavlink.constants import AUTOPILOT, FORCE, MavCmd, MavFrame
from fleet_mavlink.messages import (
    CommandInt,
    CommandLong,
    MavlinkCommand,
    MavlinkMessage,
    SetPositionTargetGlobalInt,
    SetPositionTargetLocalNed,
)
from fleet_mavlink.state import VehicleState
from fleet_mavlink.statustext import Sentence
from fleet_mavlink.vehicle_kind import Brake, VehicleKind
from fleet_mavlink.vocabulary import NO_TRANSITION

_SLOWEST = 0.2  # m/s
VELOCITY_AND_YAW_RATE = 0x5C7  # type_mask: ignore everything except velocity and yaw rate


class CalibrationStep(msgspec.Struct, frozen=True):
    """Progress of one compass, percent; ``others``: all compasses being calibrated."""

    percent: float
    compass: int = 0
    others: frozenset[int] = frozenset({0})


class Flavour(VehicleKind):
    """One autopilot firmware, for a type of vehicle that this adapter moves."""

    external: ClassVar[str]  # follows our stream of setpoints
    hold: ClassVar[str]  # brakes and stays, without a pilot at the sticks
    goto: ClassVar[str]  # flies to a given position
    land: ClassVar[str]
    return_home: ClassVar[str]
    arming: ClassVar[str]  # can be armed, and take off, in this mode
    takeoff: ClassVar[str]  # shown during a take-off
    takes_off_in_air: ClassVar[bool]  # accepts a take-off in the air, too
    takeoff_tolerance: ClassVar[
        str | None
    ]  # parameter: m below the height at which it ends a take-off by itself
    mission: ClassVar[str]  # flies the stored mission
    home_is_first: ClassVar[bool]  # item 0 of a mission is home
    rewind: ClassVar[CommandLong | None]  # before a start, if that would continue at the last item
    lands_once: ClassVar[str] = ""  # its words when it does not arm after a planned landing before a rewind
    repeats_reached: ClassVar[bool]  # reports the last reached item again and again
    unset: ClassVar[float]  # value of an item's parameter that is left to the autopilot
    lead_in: ClassVar[float]  # s of setpoints before it accepts the external mode
    follows: ClassVar[Mapping[str, frozenset[str]]]  # mode -> modes that it changes to by itself
    compass_start: ClassVar[CommandLong]
    compass_stop: ClassVar[CommandLong]
    surface: ClassVar[bool] = False  # moves on ground or water: has no height, stands when not moved
    rest: ClassVar[float] = 1.0  # s of zero velocity before the change to its own hold
    tolerance: ClassVar[float] = 0.5  # m from a goal that counts as reached
    lacking: ClassVar[Mapping[str, str]] = (
        NO_TRANSITION  # unsupported commands of the vocabulary, with the reason
    )
    wings: ClassVar[bool] = False  # circles instead of standing: ``wings.Winged``
    tries_brakes: ClassVar[bool] = False  # is stopped by the first brake that it accepts, not by its hold
    takeoff_height: ClassVar[str | None] = None  # parameter: m above home, default height of a take-off
    speed_kind: ClassVar[float] = 1.0  # param1 of DO_CHANGE_SPEED: over ground
    lowest: ClassVar[float] = 1.0  # m above home, lowest goal and take-off; only a landing goes below
    checks_mission: ClassVar[float] = 0.0  # s in which a mission just uploaded may still be refused
    mission_ends: ClassVar[tuple[str, ...]] = ()  # modes to which it changes by itself after a mission
    passes: ClassVar[float] = 15.0  # m from the last position, within which it may count as reached
    forward: ClassVar[Flavour | None] = None  # flavour for missions, and for far goals
    transitions: ClassVar[Mapping[str, str]] = {}  # flight state -> mode that leads to it; empty: a command

    @property
    def flavour(self) -> Flavour:
        """Itself: such a vehicle is moved here."""
        return self

    @property
    def ours(self) -> frozenset[str]:
        """Modes in which only we move the vehicle."""
        return frozenset({self.external, self.hold, self.goto, self.arming, self.takeoff})

    @property
    def settings(self) -> tuple[str, ...]:
        """Parameters that it needs for moving, of those in ``state.SETTINGS``."""
        return ()

    @property
    def hovers_at_home(self) -> bool:
        """Whether its return home ends without a landing."""
        return self.surface

    def comes_down(self, state: VehicleState) -> bool:
        """Return True while it lands, or flies home, by itself."""
        return self.mode_of(state) in {self.land, self.return_home}

    @property
    def failsafe_table(self) -> str:
        """Name of its table of fail-safe parameters."""
        return self.name

    def cannot(
        self,
        velocity: Velocity,  # noqa: ARG002 - multirotors move in any direction
        *,
        turns_in_place: bool | None,  # noqa: ARG002
    ) -> str:
        """Return why it cannot move like this, empty if it can."""
        return ""

    def setpoint(self, velocity: Velocity, heading: float, system: int) -> SetPositionTargetLocalNed:
        """Return the setpoint for a body velocity, rotated to NED, which all autopilots interpret alike.

        ``heading`` is radians clockwise from north. The yaw rate is always set, because otherwise ArduPilot
        turns the nose into the direction of travel.
        """
        linear = velocity.linear
        # By the heading FRD turns into NED, as FLU turns into ENU by the yaw.
        world = rotate_to_world(Vector3(linear.x, -linear.y, -linear.z), heading)
        return ned_setpoint(world, -velocity.yaw_rate, system)

    def command_before_go(self, *, backwards: bool) -> CommandLong | None:  # noqa: ARG002 - not needed
        """Return the command that must precede a go command, or None."""
        return None

    @abstractmethod
    def mode_command(self, mode: str) -> CommandLong:
        """Return the command that changes to a mode."""

    def land_command(self) -> MavlinkCommand:
        """Return the command that lands; the ``land`` mode is then shown."""
        return self.mode_command(self.land)

    @abstractmethod
    def hold_command(self, state: VehicleState) -> MavlinkCommand:
        """Return the command that brakes at once and stays; the ``hold`` mode is then shown."""

    def holding(self, state: VehicleState) -> Brake:
        """Return the best brake for the present state."""
        if self.tries_brakes and (brakes := self.brakes(state)):
            return brakes[0]
        return Brake(self.hold, self.hold_command(state))

    @abstractmethod
    def takeoff_command(self, altitude: float, home_altitude: float) -> MavlinkCommand:
        """Return the command that climbs to ``altitude`` m above home (at ``home_altitude`` m AMSL)."""

    @abstractmethod
    def go_command(
        self, to: GeoPoint, home_altitude: float, speed: float, heading: float
    ) -> CommandInt | SetPositionTargetGlobalInt:
        """Return the message that flies to a position (altitude AMSL).

        ``heading``: direction of the nose, radians from north. A command is acknowledged and changes the
        mode; a position target is accepted in the ``goto`` mode only, and the vehicle reports it instead of
        an acknowledgement.
        """

    @abstractmethod
    def command_after_go(self, speed: float, state: VehicleState) -> CommandLong | None:
        """Return the command that must follow a go command to apply its speed, or None."""

    def speed_to(
        self,
        state: VehicleState,  # noqa: ARG002 - planes have a lowest airspeed
        limit: float | None,
        wanted: float | None,
        metres: float,  # noqa: ARG002 - QuadPlanes fly far goals on their wings
    ) -> float:
        """Return the speed to a position at this distance: the wanted one, within the limit.

        Raises Refused if it cannot fly at that speed.
        """
        most = limit or math.inf
        return max(_SLOWEST, min(most, wanted or most))

    @abstractmethod
    def calibration_step(self, said: MavlinkMessage | Sentence) -> CalibrationStep | None:
        """Interpret a message about compass calibration, None for any other; raises Refused if it failed."""


def ned_setpoint(velocity: Vector3, yaw_rate: float, system: int) -> SetPositionTargetLocalNed:
    """Return the setpoint for a velocity in NED (m/s) and a yaw rate to the right (rad/s)."""
    return SetPositionTargetLocalNed(
        target_system=system,
        target_component=AUTOPILOT,
        coordinate_frame=MavFrame.LOCAL_NED,
        type_mask=VELOCITY_AND_YAW_RATE,
        vx=velocity.x,
        vy=velocity.y,
        vz=velocity.z,
        yaw_rate=yaw_rate,
    )


def arm_command(*, arm: bool, force: bool) -> CommandLong:
    """Return the command that arms or disarms; ``force`` skips the autopilot's own checks."""
    return CommandLong(
        MavCmd.COMPONENT_ARM_DISARM, param1=1.0 if arm else 0.0, param2=FORCE if force else 0.0
    )
