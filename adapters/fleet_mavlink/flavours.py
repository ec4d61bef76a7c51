"""Which autopilot a heartbeat comes from."""

from __future__ import annotations

from collections.abc import Mapping

from fleet_mavlink.ardupilot import ArduCopter
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.messages import Heartbeat
from fleet_mavlink.px4 import Px4
from fleet_mavlink.words import VEHICLE_TYPES

_BY_AUTOPILOT: Mapping[int, Flavour] = {3: ArduCopter(), 12: Px4()}


def flavour_of(heartbeat: Heartbeat) -> Flavour | None:
    """Return the flavour of a multirotor on ArduPilot or PX4, None for anything else."""
    if heartbeat.type not in VEHICLE_TYPES:
        return None
    return _BY_AUTOPILOT.get(heartbeat.autopilot)
