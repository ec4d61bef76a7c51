"""A simulated vehicle on a link: bytes in, bytes out. Still no I/O and no clock."""

from __future__ import annotations

from collections.abc import Iterable
from random import Random
from typing import Any

from pymavlink.dialects.v20 import all as mav

from fleet.sim.faults import BadWire
from fleet_mavlink.sim.components import ACCESSORIES, framed
from fleet_mavlink.sim.vehicle import ARDUPILOT_GREETING, SimVehicle


class MavlinkWire:
    """One vehicle, and its other components, speaking MAVLink 2 frames."""

    def __init__(self, vehicle: SimVehicle, accessories: Iterable[str] = ()) -> None:
        self.vehicle = vehicle
        self._parser = _parser()
        self._packer = mav.MAVLink(None, srcSystem=vehicle.system_id, srcComponent=1)
        self._accessories = [ACCESSORIES[name](vehicle) for name in accessories]
        self._inbound = BadWire(vehicle.faults, Random(vehicle.system_id))  # noqa: S311 - repeatable
        self._outbound = BadWire(vehicle.faults, Random(vehicle.system_id + 1000))  # noqa: S311

    def greeting(self) -> list[bytes]:
        """Return the start of a stream link: ArduPilot writes plain text before its frames."""
        self._parser = _parser()
        return [ARDUPILOT_GREETING] if self.vehicle.flavour == "ardupilot" else []

    def receive(self, data: bytes, now: float) -> list[bytes]:
        """Process bytes from a station; return the immediate answers."""
        frames: list[bytes] = []
        for piece in self._inbound.carry([data], now):
            frames.extend(self._handle(piece, now))
        return self._outbound.carry(frames, now)

    def step(self, now: float) -> list[bytes]:
        """Advance the vehicle to ``now``; return the due frames."""
        frames: list[bytes] = []
        for piece in self._inbound.carry((), now):
            frames.extend(self._handle(piece, now))
        frames.extend(framed(self._packer, self.vehicle.step(now)))
        frames = self._outbound.carry(frames, now)
        for accessory in self._accessories:
            frames.extend(accessory.step(now))
        return frames

    def _handle(self, data: bytes, now: float) -> list[bytes]:
        """Return the frames that answer the received data, from the autopilot and the other components."""
        frames: list[bytes] = []
        for message in self._parser.parse_buffer(data) or ():
            if message.get_type() == "BAD_DATA":
                continue
            if message.get_type() == "SETUP_SIGNING":
                self._sign(message)
                continue
            answers = [
                each.framed(said) for each in self._accessories if (said := each.requested(message, now))
            ]
            if answers:
                frames.extend(answers[0])
            else:
                frames.extend(framed(self._packer, self.vehicle.handle(message, now)))
        return frames

    def _sign(self, message: Any) -> None:
        """Set a key, as ArduPilot does while it is disarmed; PX4 has no signing. Never acknowledged."""
        meant = message.target_system == self.vehicle.system_id
        if self.vehicle.flavour != "ardupilot" or self.vehicle.pilot.armed or not meant:
            return
        signs = any(message.secret_key)
        for end in (self._parser, self._packer):
            end.signing.secret_key = bytes(message.secret_key) if signs else None
            end.signing.timestamp = message.initial_timestamp
            end.signing.sign_outgoing = signs


def _parser() -> Any:
    """Return a new parser that resynchronises after garbage."""
    parser = mav.MAVLink(None)
    parser.robust_parsing = True
    return parser
