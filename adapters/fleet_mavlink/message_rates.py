"""Requests the messages that this adapter needs, and repeats requests for those that do not arrive.

ArduPilot sends only heartbeats and texts until others are requested, and forgets the rates when it reboots.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping

from fleet import CommandError
from fleet_mavlink import payload_messages
from fleet_mavlink.commander import Commander
from fleet_mavlink.constants import AUTOPILOT, MavCmd
from fleet_mavlink.messages import (
    INCOMING,
    Attitude,
    BatteryStatus,
    CommandLong,
    ExtendedSysState,
    GlobalPositionInt,
    GpsRawInt,
    HomePosition,
    MissionCurrent,
    RequestDataStream,
    SysStatus,
    SystemTime,
)
from fleet_mavlink.vehicle import Vehicle
from fleet_mavlink.vehicle_kind import VehicleKind

_POLL_INTERVAL = 1.0  # s between checks of the arriving messages
_PATIENCE = 3.0  # s, or three periods, without a message after which it is requested again
_REQUEST_AGAIN = 5.0  # s between requests for the same message
_LEGACY_AFTER = 2  # requests for the attitude without effect, before REQUEST_DATA_STREAM
_VFR_HUD = 74
_SHOWN: Mapping[int, float] = {_VFR_HUD: 2.0}  # messages for ground stations only
_KIND = {kind.message_id: kind for kind in (*INCOMING, *payload_messages.INCOMING)}


def wanted_rates(
    pose: float, kind: VehicleKind, *, imu: float = 0.0, motors: float = 0.0
) -> Mapping[int, float]:
    """Return message id -> Hz; ``pose``: rate of position and attitude; rates of 0 are left out."""
    sensors = {kind.imu: imu, kind.motors: motors}
    return {
        ExtendedSysState.message_id: 2.0,  # a stop of a VTOL depends on it
        Attitude.message_id: pose,
        GlobalPositionInt.message_id: pose,
        SysStatus.message_id: 1.0,
        GpsRawInt.message_id: 1.0,
        HomePosition.message_id: 1.0,
        BatteryStatus.message_id: 0.5,
        MissionCurrent.message_id: 0.5,
        SystemTime.message_id: 1.0,
        **kind.rates,
        **{message: rate for message, rate in sensors.items() if message is not None and rate},
    }


class MessageRates:
    """Maintains the message rates of one vehicle."""

    def __init__(
        self,
        vehicle: Vehicle,
        commander: Commander,
        pose: float,
        *,
        imu: float = 0.0,
        motors: float = 0.0,
    ) -> None:
        self._vehicle = vehicle
        self._commander = commander
        self._pose = pose
        self._sensors = {"imu": imu, "motors": motors}
        self._requested_at: dict[int, float] = {}
        self._unanswered = 0
        self._refused: set[int] = set()

    async def run(self) -> None:
        """Request and check periodically, until cancelled."""
        agreed = (0, 0)
        while True:
            generation = (self._vehicle.state.reboots, self._vehicle.switches)
            if not self._vehicle.connected or generation != agreed:
                agreed = generation
                self._forget()
            kind = self._vehicle.kind
            if self._vehicle.connected and not self._vehicle.clashing and kind is not None:
                await self._request_for_missing(kind)
            await self._look_again()

    async def _look_again(self) -> None:
        """Wait for the next check; a vehicle that returns is checked at once."""
        vehicle = self._vehicle
        if vehicle.connected:
            await asyncio.sleep(_POLL_INTERVAL)
        else:
            await vehicle.until(lambda state: state.connected(vehicle.now()), _POLL_INTERVAL)

    def _forget(self) -> None:
        """Start over: the vehicle has lost its rates."""
        self._requested_at.clear()
        self._refused.clear()
        self._unanswered = 0

    async def _request_for_missing(self, kind: VehicleKind) -> None:
        """Request each message once, and again if it does not arrive."""
        shown = _SHOWN if self._vehicle.shown_at is not None else {}
        for message_id, rate in {**shown, **wanted_rates(self._pose, kind, **self._sensors)}.items():
            if message_id not in self._refused and self._is_due(message_id, rate):
                await self._request(message_id, rate)
        if self._unanswered > _LEGACY_AFTER:
            self._request_data_streams(kind)

    def _is_due(self, message_id: int, rate: float) -> bool:
        """Return True if a message was never requested, or is overdue."""
        now = self._vehicle.now()
        requested = self._requested_at.get(message_id)
        if requested is None:
            return True
        seen = self._seen_at(message_id)
        patience = max(_PATIENCE, 3 / rate)
        return now - seen > patience and now - requested > max(_REQUEST_AGAIN, patience)

    def _seen_at(self, message_id: int) -> float:
        """Return the time of a message's last arrival."""
        if message_id in _KIND:
            return self._vehicle.seen_at.get(_KIND[message_id], -math.inf)
        return (self._vehicle.shown_at or {}).get(message_id, -math.inf)

    async def _request(self, message_id: int, rate: float) -> None:
        """Request one message; a refusal stands until the vehicle reboots."""
        if message_id == Attitude.message_id and message_id in self._requested_at:
            self._unanswered += 1
        self._requested_at[message_id] = self._vehicle.now()
        interval = 1e6 / rate
        request = CommandLong(MavCmd.SET_MESSAGE_INTERVAL, param1=float(message_id), param2=interval)
        try:
            await self._commander.request(request, tries=1, yields=True)
        except CommandError as error:
            self._vehicle.log.info("it does not send message %s: %s", message_id, error)
            if error.device_result is not None:
                self._refused.add(message_id)

    def _request_data_streams(self, kind: VehicleKind) -> None:
        """Request groups of messages, for old firmware; this is never acknowledged."""
        self._unanswered = 0
        for stream in kind.data_streams:
            self._vehicle.send(
                RequestDataStream(
                    target_system=self._vehicle.system,
                    target_component=AUTOPILOT,
                    req_stream_id=stream,
                    req_message_rate=max(1, round(self._pose)),
                )
            )
