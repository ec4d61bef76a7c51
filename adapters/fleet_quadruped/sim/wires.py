"""Buses of a simulated robot as bad wires, independent in each direction."""

from __future__ import annotations

import random
import struct
from collections.abc import Iterable, Sequence

from fleet import CanFrame
from fleet.sim.faults import BadWire

_HEAD = struct.Struct("<I??")


class BadBuses:
    """Carries frames from and to a robot; without ``faults`` immediately. ``seed`` determines the losses."""

    def __init__(self, buses: Iterable[str], seed: int) -> None:
        self.faults: dict[str, float] = {}
        rng = random.Random(seed)  # noqa: S311 - reproducible
        names = list(buses)
        self._in = {bus: BadWire(self.faults, rng) for bus in names}
        self._out = {bus: BadWire(self.faults, rng) for bus in names}

    def to_dog(self, bus: str, frames: Sequence[CanFrame], now: float) -> Sequence[CanFrame]:
        """Return the frames that arrive at the robot now."""
        return self._carried(self._in[bus], frames, now)

    def from_dog(self, bus: str, frames: Sequence[CanFrame], now: float) -> Sequence[CanFrame]:
        """Return the frames that arrive from the robot now."""
        return self._carried(self._out[bus], frames, now)

    def _carried(self, wire: BadWire, frames: Sequence[CanFrame], now: float) -> Sequence[CanFrame]:
        if not self.faults:
            return frames
        raw = wire.carry([_HEAD.pack(frame.id, frame.fd, frame.remote) + frame.data for frame in frames], now)
        return [_frame(data) for data in raw]


def _frame(data: bytes) -> CanFrame:
    identifier, fd, remote = _HEAD.unpack_from(data)
    return CanFrame(identifier, data[_HEAD.size :], fd, remote)
