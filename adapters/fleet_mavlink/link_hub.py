"""Hub of one link URL, shared by all robots on it: opens the link, sends heartbeats, routes by vehicle."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import OrderedDict
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from typing import Any

import msgspec

from fleet import Address, Clock, Link, LinkLost, LinkRefused
from fleet_mavlink.authentication import FrameAuthentication
from fleet_mavlink.codec import PLAIN, UNREAD, Frame, Packer, Parser, pack
from fleet_mavlink.constants import AUTOPILOT, NO_AUTOPILOT
from fleet_mavlink.messages import CommandAck, Heartbeat, MavlinkMessage
from fleet_mavlink.mission_messages import INCOMING as MISSION_MESSAGES
from fleet_mavlink.redundant_links import RedundantLinks, open_links
from fleet_mavlink.signing import Signer
from fleet_mavlink.state import SILENCE
from fleet_mavlink.vehicle import Vehicle

_LOG = logging.getLogger(__name__)
_BEAT = 1.0  # s
_SENDERS = 256  # senders whose partial frames are kept
_ADDRESSED: frozenset[type[MavlinkMessage]] = frozenset({CommandAck, *MISSION_MESSAGES})
_BESIDE = 1  # signature link id for frames sent off the event loop, which have time stamps of their own
_GCS = 6  # MAV_TYPE: PX4 sends its texts only once it hears a ground station


class LinkHub:
    """An open link and the vehicles on it; we are station ``system``/``component`` to all of them."""

    def __init__(self, link: Link, clock: Clock, system: int, component: int) -> None:
        self.link = link
        self.system = system
        self.component = component
        self._clock = clock
        self._packer = Packer(system, component)
        self._parsers: OrderedDict[Address, Parser] = OrderedDict()
        self._vehicles: dict[int, Vehicle] = {}
        self._heard: dict[int, float] = {}  # last reception from each autopilot
        self._taps: dict[int, Callable[[Frame], None]] = {}  # receiver of every frame of a vehicle
        self.broken = 0  # frames with a wrong checksum

    @property
    def heard(self) -> tuple[int, ...]:
        """System ids of the autopilots received on this link within the last 3 s."""
        now = self._clock.monotonic()
        return tuple(sorted(system for system, at in self._heard.items() if now - at <= SILENCE))

    @property
    def unclaimed(self) -> tuple[int, ...]:
        """Those of them that no robot uses."""
        return tuple(system for system in self.heard if system not in self._vehicles)

    @contextlib.contextmanager
    def vehicle(
        self, system: int, signer: Signer | None = None, *, accept_unsigned: bool = False
    ) -> Iterator[Vehicle]:
        """Assign the vehicle with this id to one robot; raises LinkRefused if another robot has it.

        With a ``signer`` all frames to it are signed, and frames from it must be, unless ``accept_unsigned``.
        """
        if system in self._vehicles:
            raise LinkRefused(
                f"{self.link.url}: two robots have system_id {system}; give each its own in fleet.yaml"
            )
        trust = FrameAuthentication(signer, accept_unsigned=accept_unsigned)

        def send(message: MavlinkMessage, address: Address) -> None:
            self.link.send(self._packer.pack(message, trust.frame_settings), address)

        vehicle = self._vehicles[system] = Vehicle(system, self._clock, send, trust)
        try:
            yield vehicle
        finally:
            del self._vehicles[system]

    @contextlib.contextmanager
    def tap(self, system: int, give: Callable[[Frame], None]) -> Iterator[None]:
        """Pass every frame of a vehicle, unchanged, to ``give`` as well, which must not raise."""
        self._taps[system] = give
        try:
            yield
        finally:
            del self._taps[system]

    def receive(self, data: bytes, address: Address) -> None:
        """Process received bytes; never raises."""
        try:
            parser = self._parser(address)
            before = parser.broken
            for frame in parser.feed(data, every=bool(self._taps)):
                self._route(frame, address)
            self.broken += parser.broken - before
        except Exception:  # noqa: BLE001 - one bad message must not end the link of all vehicles
            _LOG.exception("%s: dropped %d bytes from %s", self.link.url, len(data), address)

    def _parser(self, address: Address) -> Parser:
        """Return the parser of one sender; the least recently used one is dropped to make room."""
        parser = self._parsers.get(address)
        if parser is None:
            parser = self._parsers[address] = Parser()
            if len(self._parsers) > _SENDERS:
                self._parsers.popitem(last=False)
        self._parsers.move_to_end(address)
        return parser

    def _route(self, frame: Frame, address: Address) -> None:
        """Route a message to its vehicle; only autopilots are vehicles, and only acks for us are accepted."""
        message, flies = frame.message, frame.component == AUTOPILOT
        if frame.system == 0:
            return
        if flies and isinstance(message, Heartbeat) and message.autopilot != NO_AUTOPILOT:
            self._heard[frame.system] = self._clock.monotonic()
        vehicle = self._vehicles.get(frame.system)
        if vehicle is None or not vehicle.trust.admits(frame):
            return
        tap = self._taps.get(frame.system)
        if tap is not None and vehicle.address in {None, address}:
            tap(frame)
        if message is UNREAD:
            return
        if type(message) in _ADDRESSED and not self._is_for_us(message):
            vehicle.trust.counts["answers to other stations"] += tap is None
            return
        if flies:
            vehicle.handle_message(message, address)
        else:
            vehicle.handle_component_message(frame.component, message)

    def _is_for_us(self, answer: Any) -> bool:
        """Return True if an answer is for us; autopilots that do not fill in the target send 0."""
        return answer.target_system in {0, self.system} and answer.target_component in {0, self.component}

    def send_from_any_thread(self, messages: list[MavlinkMessage], vehicle: Vehicle) -> bool:
        """Send messages to a vehicle off the event loop, with their own sequence numbers; raises LinkLost.

        Returns False if there were none, or if one was dropped because no address is known yet.
        """
        settings = msgspec.structs.replace(vehicle.trust.frame_settings, link=_BESIDE)
        frames = [
            pack(message, self.system, self.component, sequence, settings)
            for sequence, message in enumerate(messages)
        ]
        written = [self.link.send(frame, vehicle.address) for frame in frames]
        return bool(written) and all(written)

    async def beat(self) -> None:
        """Send a heartbeat once a second; ends with the link."""
        with contextlib.suppress(LinkLost):
            while True:
                peers = {(each.address, each.trust.frame_settings) for each in self._vehicles.values()}
                if isinstance(self.link, RedundantLinks):  # links that are not in use get heartbeats as well
                    peers |= {(None, settings) for _, settings in peers}
                beat = Heartbeat(type=_GCS, autopilot=NO_AUTOPILOT, system_status=4)
                for address, settings in peers or {(None, PLAIN)}:
                    self.link.send(self._packer.pack(beat, settings), address)
                await asyncio.sleep(_BEAT)


@contextlib.asynccontextmanager
async def open_hub(urls: Sequence[str], clock: Clock, system: int, component: int) -> AsyncIterator[LinkHub]:
    """Open a link, or several to the same vehicles, and send heartbeats until the last robot leaves.

    Raises LinkRefused or LinkLost.
    """
    hub: LinkHub | None = None

    def receive(data: bytes, address: Address) -> None:
        if hub is not None:
            hub.receive(data, address)

    link = await open_links(urls, receive)
    hub = LinkHub(link, clock, system, component)
    beating = asyncio.create_task(hub.beat(), name=f"mavlink heartbeat {link.url}")
    try:
        yield hub
    finally:
        beating.cancel()
        await asyncio.gather(beating, return_exceptions=True)
        await link.close()
