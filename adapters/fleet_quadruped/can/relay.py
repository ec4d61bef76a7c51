"""Relay of CAN frames from the body controller to a recorder, through the adapter's process.

The body controller writes the frames of a cycle as one message, only while they are wanted, and never blocks:
messages that do not fit into the socket are dropped and counted.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
from collections.abc import AsyncIterator, Iterable

import msgspec

from fleet import LinkTap, msgpack_decoder, tap_of
from fleet_quadruped.can.capture import Captured

_LARGEST = 256 * 1024  # bytes of a message; a cycle has a few kilobytes
_BATCH = 8  # messages read per wake-up


class RelayedFrame(msgspec.Struct, frozen=True, array_like=True):
    """One frame: Unix s, bus, True if we sent it, and its bytes in the format of a ``can:`` link."""

    time: float
    bus: str
    sent: bool
    data: bytes


class RelayedFrames(msgspec.Struct, frozen=True, array_like=True):
    """The frames of one cycle, and the number dropped since the start."""

    frames: list[RelayedFrame]
    dropped: int


_DECODER = msgpack_decoder(RelayedFrames)


class RelaySender:
    """Sending end, in the body controller; it always takes the frames before the first cycle.

    ``dropped``: number of frames that did not fit, since the start.
    """

    def __init__(self, end: socket.socket) -> None:
        self._end = end
        self._wanted = True
        self._cycle: list[RelayedFrame] = []
        self.dropped = 0

    def add(self, captured: Captured) -> None:
        """Add a frame to the cycle, if frames are wanted."""
        if self._wanted:
            data = captured.frame.packed()
            self._cycle.append(RelayedFrame(captured.time, captured.bus, captured.sent, data))

    def end_cycle(self, *, wanted: bool) -> None:
        """Write the frames of a cycle; ``wanted``: take those of the next cycle as well."""
        self._wanted = wanted
        if not self._cycle:
            return
        frames, self._cycle = self._cycle, []
        try:
            self._end.send(msgspec.msgpack.encode(RelayedFrames(frames, self.dropped)))
        except OSError:  # the adapter is slow, or has ended
            self.dropped += len(frames)


class RelayReceiver:
    """Receiving end, in the adapter: passes frames to the taps of the buses."""

    def __init__(
        self, end: socket.socket, relay: socket.socket, buses: Iterable[str], log: logging.Logger
    ) -> None:
        self.relay = relay
        self._end = end
        self._taps: dict[str, LinkTap] = {name: tap_of(name) for name in buses}
        self._dropped = 0
        self._log = log

    def wanted(self) -> bool:
        """Return True while a recorder wants frames; from any thread."""
        return any(tap.note is not None for tap in self._taps.values())

    def read(self) -> None:
        """Read the messages that have arrived."""
        for _ in range(_BATCH):
            try:
                data = self._end.recv(_LARGEST)
            except (BlockingIOError, InterruptedError):
                return
            if not data:  # the body controller has ended
                asyncio.get_running_loop().remove_reader(self._end)
                return
            self._pass_on(_DECODER.decode(data))

    def _pass_on(self, relayed: RelayedFrames) -> None:
        """Pass the frames of one cycle to the taps."""
        if relayed.dropped > self._dropped:
            self._log.warning("%d frames were not recorded", relayed.dropped - self._dropped)
            self._dropped = relayed.dropped
        for frame in relayed.frames:
            note = self._taps[frame.bus].note
            if note is not None:
                note("out" if frame.sent else "in", frame.data, at=frame.time)


@contextlib.asynccontextmanager
async def received(buses: Iterable[str], log: logging.Logger) -> AsyncIterator[RelayReceiver]:
    """Create a relay and read it for the duration of a block; its ``relay`` is the body controller's end."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        for end in (ours, theirs):
            end.setblocking(False)
        receiver = RelayReceiver(ours, theirs, buses, log)
        loop = asyncio.get_running_loop()
        loop.add_reader(ours, receiver.read)
        try:
            yield receiver
        finally:
            loop.remove_reader(ours)
