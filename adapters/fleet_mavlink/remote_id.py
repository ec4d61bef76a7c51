"""Remote ID: sends the operator's position to the autopilot; checks that the transmitter permits take-off."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable

from fleet import LinkLost, NotReady
from fleet_mavlink.broadcast_messages import (
    OpenDroneIdBasicId,
    OpenDroneIdOperatorId,
    OpenDroneIdSelfId,
    OpenDroneIdSystem,
    OpenDroneIdSystemUpdate,
)
from fleet_mavlink.constants import AUTOPILOT, MULTIROTORS, VTOLS
from fleet_mavlink.messages import MavlinkMessage
from fleet_mavlink.remote_id_config import RemoteIdConfig
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle import Vehicle

_EPOCH = 1_546_300_800  # Unix s of 2019-01-01, epoch of Remote ID time stamps
_UPDATE = 1.0  # s between position messages, as Remote ID regulations require
_WHOLE_EVERY = 3  # position messages between complete sets of messages
_FRESH = 5.0  # s for which the transmitter's status is valid; it is sent once a second
_UNKNOWN = -1000.0  # m
_FIXED, _EU, _SERIAL_NUMBER = 2, 1, 1
_CATEGORIES = ("undeclared", "open", "specific", "certified")
_MULTIROTOR, _PLANE, _HYBRID, _OTHER = 2, 1, 4, 15  # MAV_ODID_UA_TYPE
_GOOD = 0


def trouble_of(state: VehicleState, now: float, *, wanted: bool) -> str | None:
    """Return the problem of the Remote ID transmission, empty without one.

    None: no transmitter was received, and fleet.yaml does not require one.
    """
    status, at = state.remote_id, state.remote_id_at
    if status is None:
        return "nothing is received from its Remote ID transmitter" if wanted else None
    if now - at > _FRESH:
        return f"nothing was received from its Remote ID transmitter for {now - at:.0f} s"
    return "" if status.status == _GOOD else f"Remote ID: {status.error.strip() or 'not ready'}"


def require_remote_id(vehicle: Vehicle) -> None:
    """Raise NotReady, with the transmitter's reason, while a vehicle must not take off."""
    trouble = trouble_of(vehicle.state, vehicle.now(), wanted=vehicle.needs_remote_id)
    if trouble:
        raise NotReady(trouble, hint="see remote_id in fleet.yaml, and the transmitter")


def ua_type(vehicle_type: int) -> int:
    """Return the MAV_ODID_UA_TYPE for a MAV_TYPE."""
    if vehicle_type in MULTIROTORS:
        return _MULTIROTOR
    if vehicle_type == 1:
        return _PLANE
    return _HYBRID if vehicle_type in VTOLS else _OTHER


def update(config: RemoteIdConfig, system: int, unix: float) -> OpenDroneIdSystemUpdate:
    """Return the position of the operator at a time."""
    return OpenDroneIdSystemUpdate(system, AUTOPILOT, *_place(config), config.altitude, _since(unix))


def everything(config: RemoteIdConfig, system: int, kind: int, unix: float) -> list[MavlinkMessage]:
    """Return the complete set of messages; values missing in fleet.yaml are left out."""
    target = (system, AUTOPILOT)
    category = _CATEGORIES.index(config.category)
    messages: list[MavlinkMessage] = [
        OpenDroneIdSystem(
            *target,
            operator_location_type=_FIXED,
            classification_type=_EU if category else 0,
            operator_latitude=_place(config)[0],
            operator_longitude=_place(config)[1],
            area_count=1,
            area_radius=0,
            area_ceiling=_UNKNOWN,
            area_floor=_UNKNOWN,
            category_eu=category,
            class_eu=config.class_eu,
            operator_altitude_geo=config.altitude,
            timestamp=_since(unix),
        ),
        OpenDroneIdOperatorId(*target, 0, config.operator_id),
        OpenDroneIdSelfId(*target, 0, config.description),
    ]
    if config.serial_number:
        number = tuple(config.serial_number.encode().ljust(20, b"\0"))
        messages.append(OpenDroneIdBasicId(*target, _SERIAL_NUMBER, ua_type(kind), number))
    return messages


def _place(config: RemoteIdConfig) -> tuple[int, int]:
    """Return the position of the operator, degrees times 1e7."""
    return round(config.latitude * 1e7), round(config.longitude * 1e7)


def _since(unix: float) -> int:
    """Return a Remote ID time stamp."""
    return max(0, math.floor(unix) - _EPOCH)


class RemoteId:
    """Sends the operator's position to the autopilot once a second; ``unix`` returns Unix seconds."""

    def __init__(self, vehicle: Vehicle, config: RemoteIdConfig | None, unix: Callable[[], float]) -> None:
        self._vehicle = vehicle
        self._config = config
        self._unix = unix
        vehicle.needs_remote_id = config is not None

    async def run(self) -> None:
        """Send it, until cancelled."""
        count = 0
        while True:
            with contextlib.suppress(LinkLost):
                self._send(whole=count % _WHOLE_EVERY == 0)
            count += 1
            await asyncio.sleep(_UPDATE)

    def _send(self, *, whole: bool) -> None:
        """Send the position of the operator, or the complete set; raises LinkLost."""
        beat = self._vehicle.state.heartbeat
        if self._config is None or beat is None or not self._vehicle.connected:
            return
        system, now = self._vehicle.system, self._unix()
        if whole:
            for each in everything(self._config, system, beat.type, now):
                self._vehicle.send(each)
        self._vehicle.send(update(self._config, system, now))
