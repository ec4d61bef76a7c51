"""A CAN bus as the link of one robot; it carries packed frames (``CanFrame.packed``).

A thread reads the bus, because most of python-can's interfaces have nothing that an event loop can wait for.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections import deque

from fleet.clock import SystemClock
from fleet.errors import LinkLost
from fleet.link.base import Address, LinkStats, Receiver
from fleet.link.canbus.bus import BusUrl, OpenCanBus, parse_link
from fleet.link.canbus.frame import CanFrame
from fleet.link.link_end import LinkEnd
from fleet.link.tap import tap_of

log = logging.getLogger(__name__)

_POLL = 0.05  # s that one read waits: bounds the time of a close
_BACKLOG = 4096  # frames that wait for the loop; beyond it the oldest are dropped and counted
_BATCH = 256  # frames handed over in one iteration of the loop
_FULL = 1 << 20  # bytes reported as unsent while the queue is full: more than any motion
_CLASSIC = 1_000_000  # bit/s, for interfaces without a configured rate


class CanLink:
    """An open bus. ``send`` may be called from any thread."""

    def __init__(self, url: str, bus: OpenCanBus, receiver: Receiver, *, fd: bool) -> None:
        self.url = url
        self.stats = LinkStats()
        self._bus = bus
        self._receiver = receiver
        self._fd = fd
        self._ending = LinkEnd(url)
        self._tap = tap_of(url)
        self._loop = asyncio.get_running_loop()
        self._lock = threading.Lock()  # python-can's interfaces send from one thread at a time
        self._arrived: deque[CanFrame] = deque(maxlen=_BACKLOG)
        self._due = False  # a hand-over is scheduled
        self._reader = threading.Thread(target=self._read, name="fleet-can", daemon=True)
        self._reader.start()

    def fileno(self) -> int:
        """Return -1: python-can does the writes."""
        return -1

    def unsent(self) -> int:
        """Return more than any motion while the transmit queue is full, so that only the newest waits."""
        return _FULL if self._bus.blocked else 0

    def send(self, data: bytes, address: Address = None) -> bool:  # noqa: ARG002 - a bus has no addresses
        """Write a packed frame, or drop and count it when the transmit queue is full.

        Raises LinkLost when the bus is dead, ValueError for bytes that are no frame of this bus.
        """
        frame = CanFrame.unpack(data)
        if frame is None:
            raise ValueError(f"{data.hex()} is no CAN frame; write CanFrame(id, data).packed()")
        if frame.fd and not self._fd:
            raise ValueError(f"{self.url} is a classic bus; for CAN FD give it a data_bitrate")
        if self._ending.ended:
            raise self._ending.error()
        with self._lock:
            before = self._bus.dropped
            self._bus.send(frame)
            self.stats.dropped = self._bus.dropped
            written = self.stats.dropped == before
        if self._bus.dead:
            raise self._ending.fall(self._bus.dead)
        self.stats.sent += 1
        if (note := self._tap.note) is not None:
            note("out", data)
        return written

    async def lost(self) -> None:
        """Wait until the bus dies, then raise LinkLost with the reason."""
        await self._ending.wait()

    async def close(self) -> None:
        """Close; nothing is received after this returns."""
        self._ending.fall("closed")
        await asyncio.to_thread(self._reader.join)
        self._bus.close()

    def _read(self) -> None:
        """Read until the link ends; runs on its own thread."""
        while not self._ending.ended:
            try:
                frames = self._bus.receive(_POLL)
            except LinkLost as error:
                self._ending.fall(self._bus.dead or str(error))
                return
            except Exception as error:  # an unread bus must not look like one without frames
                log.exception("reading %s failed", self.url)
                self._ending.fall(f"it cannot be read: {type(error).__name__}: {error}")
                return
            if not frames:
                continue
            self.stats.dropped += max(0, len(self._arrived) + len(frames) - _BACKLOG)
            self._arrived.extend(frames)
            if not self._due:
                self._due = True
                self._schedule()

    def _schedule(self) -> None:
        try:
            self._loop.call_soon_threadsafe(self._hand_over)
        except RuntimeError:  # the loop has ended, with all its waiting tasks
            self._ending.fall("its event loop has ended")

    def _hand_over(self) -> None:
        """Pass received frames to the receiver; a large rest follows in the next iteration of the loop."""
        self._due = False
        for _ in range(_BATCH):
            if self._ending.ended or not self._arrived:
                return
            self.stats.received += 1
            data = self._arrived.popleft().packed()
            if (note := self._tap.note) is not None:
                note("in", data)
            self._receiver(data, None)
        if not self._due:
            self._due = True
            self._loop.call_soon(self._hand_over)


async def open_can(url: str, receiver: Receiver) -> CanLink:
    """Open a bus as a link; raises LinkRefused when a person must act, LinkLost when it may work later."""
    parts = parse_link(url)
    bus = await asyncio.to_thread(_open, url, parts)
    return CanLink(url, bus, receiver, fd=parts.data_bitrate is not None)


def _open(url: str, parts: BusUrl) -> OpenCanBus:
    return OpenCanBus(parts.channel, url, parts.bitrate or _CLASSIC, SystemClock(), parts.data_bitrate)
