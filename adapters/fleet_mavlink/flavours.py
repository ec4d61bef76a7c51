"""Selects the flavour (if moved here) and the kind of a vehicle, from its heartbeat and its state."""

from __future__ import annotations

from collections.abc import Mapping

from fleet_mavlink.ardupilot import ArduCopter
from fleet_mavlink.ardupilot_kinds import ArduBlimp, ArduSub, ArduTracker
from fleet_mavlink.ardupilot_plane import arduplane_of
from fleet_mavlink.ardupilot_rover import ArduBoat, ArduRover
from fleet_mavlink.constants import ARDUPILOT, MULTIROTORS, PX4, VTOLS
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.messages import Heartbeat
from fleet_mavlink.px4 import Px4
from fleet_mavlink.px4_kinds import Px4Kind
from fleet_mavlink.px4_plane import px4_plane_of
from fleet_mavlink.state import VehicleState
from fleet_mavlink.unknown_kind import UnknownKind
from fleet_mavlink.vehicle_kind import VehicleKind

_COPTER, _PX4 = ArduCopter(), Px4()
_UNKNOWN, _PX4_OTHER = UnknownKind(), Px4Kind()
_NO_STATE = VehicleState()
_WINGED = (1, *VTOLS)  # MAV_TYPE: planes
_BY_TYPE: Mapping[tuple[int, int], VehicleKind] = {
    **{(ARDUPILOT, each): _COPTER for each in MULTIROTORS},
    (ARDUPILOT, 5): ArduTracker(),
    (ARDUPILOT, 7): ArduBlimp(),
    (ARDUPILOT, 10): ArduRover(),
    (ARDUPILOT, 11): ArduBoat(),
    (ARDUPILOT, 12): ArduSub(),
    **{(PX4, each): _PX4 for each in MULTIROTORS},
}
"""Kinds without wings, by MAV_AUTOPILOT and MAV_TYPE."""


def kind_of(heartbeat: Heartbeat, state: VehicleState = _NO_STATE) -> VehicleKind:
    """Return the present kind of a vehicle; the unknown kind if its modes are not known here."""
    if heartbeat.type in _WINGED and heartbeat.autopilot == ARDUPILOT:
        return arduplane_of(state)
    if heartbeat.type in _WINGED and heartbeat.autopilot == PX4:
        return px4_plane_of(heartbeat.type, state)
    otherwise = _PX4_OTHER if heartbeat.autopilot == PX4 else _UNKNOWN
    return _BY_TYPE.get((heartbeat.autopilot, heartbeat.type), otherwise)


def flavour_of(heartbeat: Heartbeat, state: VehicleState = _NO_STATE) -> Flavour | None:
    """Return the present flavour of a vehicle that is moved here; None for another."""
    return kind_of(heartbeat, state).flavour
