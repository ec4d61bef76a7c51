"""PX4 for planes and VTOLs: the modes of its multirotors, behaviour of version 1.16, as observed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from fleet import GeoPoint
from fleet_mavlink.constants import NAN, VTOL_GOES_FORWARD, VTOL_HOVERS, VTOLS, MavCmd
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.messages import CommandInt, CommandLong
from fleet_mavlink.px4 import Px4
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle_kind import Brake
from fleet_mavlink.vocabulary import WINGS_AND_ROTORS
from fleet_mavlink.wings import Winged

_HOVERS = 3  # MAV_VTOL_STATE


class Px4Plane(Winged, Px4):
    """A plane. It takes off and lands by the commands of multirotors, but in circles and along a runway."""

    lands_here: ClassVar[bool] = False
    circle: ClassVar[str] = "NAV_LOITER_RAD"
    airspeeds: ClassVar[tuple[str, str, str]] = ("FW_AIRSPD_MIN", "FW_AIRSPD_TRIM", "FW_AIRSPD_MAX")

    def go_command(self, to: GeoPoint, home_altitude: float, speed: float, heading: float) -> CommandInt:  # noqa: ARG002
        """Return DO_REPOSITION without a heading: its nose follows its course."""
        return super().go_command(to, home_altitude, speed, NAN)


class Px4Vtol(Px4):
    """A VTOL in hover, which behaves like a multirotor."""

    transitions: ClassVar[Mapping[str, str]] = {"forward": "", "hover": ""}
    lacking: ClassVar[Mapping[str, str]] = {}

    @property
    def settings(self) -> tuple[str, ...]:
        """Parameters of its wings."""
        return Px4Plane().settings

    def stands(self, state: VehicleState) -> bool:
        """Return True while it hovers."""
        return state.vtol_state in VTOL_HOVERS


class Px4VtolForward(Px4Plane):
    """A VTOL on its wings. It transitions to hover on its own for a landing, and at home."""

    lands_here: ClassVar[bool] = True
    transitions: ClassVar[Mapping[str, str]] = Px4Vtol.transitions
    lacking: ClassVar[Mapping[str, str]] = WINGS_AND_ROTORS


class Px4VtolInTransition(Px4VtolForward):
    """A VTOL in transition to its wings: a stop aborts the transition, then it holds its position."""

    tries_brakes: ClassVar[bool] = True
    goes_over: ClassVar[bool] = True

    def brakes(self, state: VehicleState) -> tuple[Brake, ...]:
        """Return the transition back to hover with the hold, then the hold alone in case it is refused."""
        back = Brake(self.hold, CommandLong(MavCmd.DO_VTOL_TRANSITION, param1=float(_HOVERS)))
        hold = self.hold_command(state)
        return Brake(self.hold, hold, first=back), Brake(self.hold, hold)


_PLANE, _HOVER, _FORWARD, _IN_TRANSITION = Px4Plane(), Px4Vtol(), Px4VtolForward(), Px4VtolInTransition()


def px4_plane_of(vehicle_type: int, state: VehicleState) -> Flavour:
    """Return the present flavour of a plane or VTOL on PX4; with an unknown VTOL state, wings."""
    if vehicle_type not in VTOLS:
        return _PLANE
    if state.vtol_state == VTOL_GOES_FORWARD:
        return _IN_TRANSITION
    return _HOVER if state.vtol_state in VTOL_HOVERS else _FORWARD
