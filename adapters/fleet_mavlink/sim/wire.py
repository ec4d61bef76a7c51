"""A simulated vehicle on a link: bytes in, bytes out. Still no I/O and no clock."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from random import Random
from typing import Any

from pymavlink.dialects.v20 import all as mav

from fleet.sim.faults import BadWire
from fleet_mavlink.sim.vehicle import ARDUPILOT_GREETING, SimVehicle

ACCESSORIES: Mapping[str, tuple[int, int]] = {  # name -> component, MAV_TYPE
    "gimbal": (154, int(mav.MAV_TYPE_GIMBAL)),
    "adsb": (156, int(mav.MAV_TYPE_ADSB)),
}


class Wire:
    """One vehicle, and the components beside it, speaking MAVLink 2 frames."""

    def __init__(self, vehicle: SimVehicle, accessories: Iterable[str] = ()) -> None:
        self.vehicle = vehicle
        self._parser = _parser()
        self._packer = mav.MAVLink(None, srcSystem=vehicle.system_id, srcComponent=1)
        self._accessories = [_Accessory(vehicle.system_id, *ACCESSORIES[name]) for name in accessories]
        self._inbound = BadWire(vehicle.faults, Random(vehicle.system_id))  # noqa: S311 - repeatable
        self._outbound = BadWire(vehicle.faults, Random(vehicle.system_id + 1000))  # noqa: S311

    def greeting(self) -> list[bytes]:
        """Return what a stream link begins with: ArduPilot writes plain text before its frames."""
        self._parser = _parser()
        return [ARDUPILOT_GREETING] if self.vehicle.flavour == "ardupilot" else []

    def receive(self, data: bytes, now: float) -> list[bytes]:
        """Take bytes from a station; return the frames that answer at once."""
        answers: list[Any] = []
        for piece in self._inbound.carry([data], now):
            answers.extend(self._handle(piece, now))
        return self._send(answers, now)

    def step(self, now: float) -> list[bytes]:
        """Move the vehicle on to ``now``; return the frames that are due."""
        told: list[Any] = []
        for piece in self._inbound.carry((), now):
            told.extend(self._handle(piece, now))
        told.extend(self.vehicle.step(now))
        frames = self._send(told, now)
        for accessory in self._accessories:
            frames.extend(accessory.step(now))
        return frames

    def _handle(self, data: bytes, now: float) -> list[Any]:
        answers: list[Any] = []
        for message in self._parser.parse_buffer(data) or ():
            if message.get_type() != "BAD_DATA":
                answers.extend(self.vehicle.handle(message, now))
        return answers

    def _send(self, messages: Iterable[Any], now: float) -> list[bytes]:
        """Return the frames of messages as they come out of the wire at ``now``."""
        frames = []
        for message in messages:
            frames.append(bytes(message.pack(self._packer)))
            self._packer.seq = (self._packer.seq + 1) & 0xFF
        return self._outbound.carry(frames, now)


class _Accessory:
    """A component that only shows that it is there: HEARTBEAT at 1 Hz."""

    def __init__(self, system_id: int, component: int, kind: int) -> None:
        self._packer = mav.MAVLink(None, srcSystem=system_id, srcComponent=component)
        self._kind = kind
        self._due = 0.0

    def step(self, now: float) -> list[bytes]:
        """Return the heartbeat when it is due."""
        if now < self._due:
            return []
        self._due = now + 1.0
        message = mav.MAVLink_heartbeat_message(
            self._kind, mav.MAV_AUTOPILOT_INVALID, 0, 0, mav.MAV_STATE_ACTIVE, 3
        )
        frame = bytes(message.pack(self._packer))
        self._packer.seq = (self._packer.seq + 1) & 0xFF
        return [frame]


def _parser() -> Any:
    """Return a fresh parser that resynchronises after garbage."""
    parser = mav.MAVLink(None)
    parser.robust_parsing = True
    return parser
