"""Sender of frames to a self-walking machine, with the required counters and checksums."""

from __future__ import annotations

from fleet import CanBus, CanFrame
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.frame_integrity import FrameIntegrity
from fleet_quadruped.frames import FrameEncoder
from fleet_quadruped.selfwalk.wire import AXES, WalkerWire


class FrameSender:
    """Sends frames to a machine on its bus."""

    def __init__(self, bus: CanBus, wire: WalkerWire) -> None:
        self._bus = bus
        self._integrity = {
            number: FrameIntegrity(number, protected) for number, protected in wire.protected.items()
        }
        self._velocities = [(frame.id, FrameEncoder(frame)) for frame in wire.velocity]

    def put(self, frame: CanFrame) -> None:
        """Send a frame, with its counter and checksum."""
        integrity = self._integrity.get(frame.id)
        self._bus.send(CanFrame(frame.id, integrity.put(frame.data)) if integrity else frame)

    def send(self, twist: Twist) -> None:
        """Send a velocity."""
        values = dict(zip(AXES, twist, strict=True))
        for number, encoder in self._velocities:
            self.put(CanFrame(number, encoder.encode(values)))
