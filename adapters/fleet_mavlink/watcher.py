"""A ground station beside the edge: one link to it, for all vehicles that are shown to it.

Frames of the vehicles are collected briefly and sent in few datagrams, because each costs a system call. The
station's link is never waited for; frames that do not fit are dropped: newer ones follow.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import OrderedDict, deque
from collections.abc import AsyncIterator, Iterator
from typing import Protocol

from fleet import Address, Clock
from fleet_mavlink.codec import Frame, Parser
from fleet_mavlink.message_targets import target_of
from fleet_mavlink.rate_limited_log import RateLimitedLog
from fleet_mavlink.redundant_links import RedundantLinks

_LOG = logging.getLogger(__name__)
_COLLECTED = 0.02  # s
_DATAGRAM = 1400  # bytes; fits into one network packet
_AT_ONCE = 16  # datagrams
_MOST_WAITING = 2000  # frames
_MOST_STATIONS = 16  # on one link
_A_SECOND, _BURST = 100.0, 200.0  # per second: messages accepted from a link


class ShownVehicle(Protocol):
    """A vehicle that is shown to a station."""

    def handle_frame(self, frame: Frame) -> None:
        """Process a message of a station; must not raise."""


class TokenBucket:
    """Token bucket: limits messages to a rate, with a burst."""

    def __init__(self, a_second: float, burst: float) -> None:
        self._a_second, self._burst = a_second, burst
        self._left, self._at = burst, 0.0

    def admits(self, now: float) -> bool:
        """Return True if one more message is permitted at ``now``, monotonic s."""
        self._left = min(self._burst, self._left + (now - self._at) * self._a_second)
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class Watcher:
    """The stations behind one link; ``stations``: those received, by system and component id."""

    def __init__(self, url: str, clock: Clock) -> None:
        self.url = url
        self.stations: OrderedDict[tuple[int, int], float] = OrderedDict()
        self.link: RedundantLinks | None = None
        self._now = clock.monotonic
        self._notices = RateLimitedLog(_LOG, clock.monotonic)
        self._parser = Parser()
        self._allowance = TokenBucket(_A_SECOND, _BURST)
        self._vehicles: dict[int, ShownVehicle] = {}
        self._waiting: deque[bytes] = deque()
        self._timer: asyncio.TimerHandle | None = None

    @contextlib.contextmanager
    def showing(self, system: int, vehicle: ShownVehicle) -> Iterator[bool]:
        """Show a vehicle; gives False, and does not show it, if another one with its id is shown already."""
        free = system not in self._vehicles
        if free:
            self._vehicles[system] = vehicle
        try:
            yield free
        finally:
            if free:
                del self._vehicles[system]

    def show(self, frame: bytes) -> None:
        """Send a frame to the stations soon, unless it is addressed to another station."""
        system, component = target_of(frame)
        if system and not self._is_here(system, component):
            return
        if len(self._waiting) >= _MOST_WAITING:
            self._notices.add("more frames than the link takes", f"{self.url}: frames were dropped")
            return
        self._waiting.append(frame)
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(_COLLECTED, self._flush)

    def _is_here(self, system: int, component: int) -> bool:
        """Return True if a station with this address was received on this link."""
        if component:
            return (system, component) in self.stations
        return any(station == system for station, _ in self.stations)

    def _flush(self) -> None:
        """Send the collected frames; those beyond a burst a moment later."""
        self._timer = None
        for _ in range(_AT_ONCE):
            if not self._waiting:
                return
            self._send(self._datagram())
        self._timer = asyncio.get_running_loop().call_later(_COLLECTED, self._flush)

    def _datagram(self) -> bytes:
        """Return as many whole frames as fit into a datagram."""
        frames = [self._waiting.popleft()]
        size = len(frames[0])
        while self._waiting and size + len(self._waiting[0]) <= _DATAGRAM:
            frames.append(self._waiting.popleft())
            size += len(frames[-1])
        return b"".join(frames)

    def _send(self, data: bytes) -> None:
        """Send on the link; data is lost while it is down."""
        if self.link is not None:
            self.link.send(data)

    def receive(self, data: bytes, _address: Address) -> None:
        """Process data from stations; never raises."""
        try:
            for frame in self._parser.feed(data, every=True):
                self._deliver(frame)
        except Exception:  # noqa: BLE001 - exception barrier: one bad message must not end the view of all vehicles
            _LOG.exception("%s: dropped %d bytes", self.url, len(data))

    def _deliver(self, frame: Frame) -> None:
        """Pass a message on to its target vehicle."""
        if not frame.system:
            return
        if not self._allowance.admits(self._now()):
            why = f"{self.url}: more than {_A_SECOND:g} messages a second"
            self._notices.add("too many messages", f"{why}: the rest is dropped")
            return
        if frame.system in self._vehicles:
            self._notices.add(
                "a vehicle's id",
                f"{self.url}: a station with system id {frame.system}, that of a vehicle, is ignored",
            )
            return
        self._meet(frame)
        system, _ = target_of(frame.raw)
        vehicle = self._vehicles.get(system)
        if vehicle is not None:
            vehicle.handle_frame(frame)
        elif system:
            self._notices.add("an unknown vehicle", f"{self.url}: no vehicle {system} is shown here")

    def _meet(self, frame: Frame) -> None:
        """Remember a station."""
        station = (frame.system, frame.component)
        if station not in self.stations:
            _LOG.info("%s: ground station %s/%s", self.url, *station)
            if len(self.stations) >= _MOST_STATIONS:
                self.stations.popitem(last=False)
        self.stations[station] = self._now()
        self.stations.move_to_end(station)

    async def close(self) -> None:
        """Close the link."""
        if self._timer is not None:
            self._timer.cancel()
        if self.link is not None:
            await self.link.close()


@contextlib.asynccontextmanager
async def open_watcher(url: str, clock: Clock) -> AsyncIterator[Watcher]:
    """Create a watcher whose link is opened, and reopened, in the background."""
    watcher = Watcher(url, clock)
    watcher.link = RedundantLinks([url], watcher.receive)
    try:
        yield watcher
    finally:
        await watcher.close()
