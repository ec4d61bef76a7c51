"""Selects the flavour (what moves it) and the kind of a vehicle from its heartbeat."""

from __future__ import annotations

from collections.abc import Mapping

from fleet_mavlink.ardupilot import ArduCopter
from fleet_mavlink.ardupilot_kinds import ArduBlimp, ArduPlane, ArduSub, ArduTracker
from fleet_mavlink.ardupilot_rover import ArduBoat, ArduRover
from fleet_mavlink.constants import ARDUPILOT, MULTIROTORS, PX4, VTOLS
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.messages import Heartbeat
from fleet_mavlink.px4 import Px4
from fleet_mavlink.px4_kinds import Px4Kind, Px4Plane
from fleet_mavlink.unknown_kind import UnknownKind
from fleet_mavlink.vehicle_kind import VehicleKind

_COPTER, _PX4, _PLANE, _PX4_PLANE = ArduCopter(), Px4(), ArduPlane(), Px4Plane()
_UNKNOWN, _PX4_OTHER = UnknownKind(), Px4Kind()
_WINGED = (1, *VTOLS)  # MAV_TYPE: planes
_BY_TYPE: Mapping[int, Mapping[int, VehicleKind]] = {
    ARDUPILOT: {
        **dict.fromkeys(MULTIROTORS, _COPTER),
        **dict.fromkeys(_WINGED, _PLANE),
        5: ArduTracker(),
        7: ArduBlimp(),
        10: ArduRover(),
        11: ArduBoat(),
        12: ArduSub(),
    },
    PX4: {**dict.fromkeys(MULTIROTORS, _PX4), **dict.fromkeys((*_WINGED, 7), _PX4_PLANE)},
}


def kind_of(heartbeat: Heartbeat) -> VehicleKind:
    """Return the kind of a vehicle; the unknown kind when its modes are not known here."""
    otherwise = _PX4_OTHER if heartbeat.autopilot == PX4 else _UNKNOWN
    return _BY_TYPE.get(heartbeat.autopilot, {}).get(heartbeat.type, otherwise)


def flavour_of(heartbeat: Heartbeat) -> Flavour | None:
    """Return the flavour of a vehicle that is moved here, None for another."""
    kind = kind_of(heartbeat)
    return kind if isinstance(kind, Flavour) else None
