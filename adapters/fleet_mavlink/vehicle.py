"""One vehicle on a link: its state, its address, and the tasks that wait for its messages."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import msgspec

from fleet import Address, Clock
from fleet_mavlink.authentication import FrameAuthentication
from fleet_mavlink.broadcast_messages import OpenDroneIdArmStatus
from fleet_mavlink.constants import CAMERA_TYPE, CAMERAS, NO_AUTOPILOT, PX4, ROVERS, type_name
from fleet_mavlink.event_messages import Event
from fleet_mavlink.events import EventDictionary
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.flavours import flavour_of, kind_of
from fleet_mavlink.messages import CommandAck, Heartbeat, MavlinkMessage, StatusTextMessage
from fleet_mavlink.payload_messages import GimbalDeviceAttitudeStatus
from fleet_mavlink.received_messages import ReceivedMessages, SaidT
from fleet_mavlink.redundant_links import link_index_of
from fleet_mavlink.state import SILENCE, VehicleState, reduce
from fleet_mavlink.statustext import Sentence, StatusTextAssembler
from fleet_mavlink.vehicle_kind import Brake, VehicleKind
from fleet_mavlink.vocabulary import OF_A_MOVED_VEHICLE, PX4_ROVER
from fleet_mavlink.wings import Winged

_REMEMBERED = 64  # texts kept
_SAME_WITHIN = 1.0  # s between an event and a text with the same content
_SWITCH_AFTER = 1.5  # s of silence after which another link is used

StateCondition = Callable[[VehicleState], bool]


class Vehicle:
    """The autopilot with one system id; only messages from its one known address are accepted.

    ``send`` sends a message to it. ``on_heartbeat``, ``on_ack`` and ``on_sentence`` are called for its
    messages, before the tasks that wait for a state are woken.
    """

    def __init__(
        self,
        system: int,
        clock: Clock,
        send: Callable[[MavlinkMessage, Address], None],
        trust: FrameAuthentication | None = None,
    ) -> None:
        self.system = system
        self.trust = trust or FrameAuthentication()
        self.clock = clock
        self.now = clock.monotonic  # clock of all time stamps about it
        self.state = VehicleState()
        self.address: Address = None
        self.sentences: deque[Sentence] = deque(maxlen=_REMEMBERED)
        self.seen_at: dict[type[MavlinkMessage], float] = {}
        self.shown_at: dict[int, float] | None = None  # messages to ground stations, by number; None: none
        self.on_heartbeat: Callable[[], None] = _nothing
        self.on_ack: Callable[[CommandAck], None] = _ignore
        self.on_sentence: Callable[[Sentence], None] = _ignore
        self.needs_remote_id = False  # for take-off, by fleet.yaml
        self.turns_in_place: bool | None = None  # on the surface; None: unknown
        self.camera: VehicleComponent | None = None
        self.dictionary: EventDictionary | None = None  # of its events
        self._event = -1  # sequence number of the last one
        self.log = logging.getLogger(__name__)  # replaced by its robot's
        self._send = send
        self._joiner = StatusTextAssembler()
        self.switches = 0  # changes of the link to it
        # its address on each link, and when it was heard
        self._addresses_by_link: dict[int, tuple[Address, float]] = {}
        self._others: dict[int, deque[tuple[Address, float]]] = {}  # other senders since its last message
        self._clash_at = -math.inf
        self._waiting: list[tuple[StateCondition, asyncio.Future[None]]] = []
        self._hearing: list[ReceivedMessages[Any]] = []

    @property
    def kind(self) -> VehicleKind | None:
        """Its kind, None before its first heartbeat."""
        return kind_of(self.state.heartbeat, self.state) if self.state.heartbeat else None

    @property
    def flavour(self) -> Flavour | None:
        """Its flavour, None before its first heartbeat and for a vehicle that is not moved here."""
        return flavour_of(self.state.heartbeat, self.state) if self.state.heartbeat else None

    @property
    def what(self) -> str:
        """Type and autopilot, as text."""
        beat = self.state.heartbeat
        return "not known yet" if beat is None else vehicle_text(beat)

    @property
    def connected(self) -> bool:
        """True while heartbeats arrive."""
        return self.state.connected(self.now())

    @property
    def clashing(self) -> bool:
        """True while a second vehicle uses the same system id."""
        return self.clashed(self.now())

    def clashed(self, now: float) -> bool:
        """Return True if a second vehicle with the same system id sent recently."""
        return now - self._clash_at <= SILENCE

    def send(self, message: MavlinkMessage) -> None:
        """Send to the vehicle, at the address of its last message; raises LinkLost."""
        self._send(message, self.address)

    def handle_message(self, message: MavlinkMessage, address: Address) -> None:
        """Process a message from this system's autopilot, unless it comes from another address."""
        now = self.now()
        if isinstance(message, Heartbeat) and message.autopilot == NO_AUTOPILOT:
            return
        if self.state.heartbeat is None and not isinstance(message, Heartbeat):
            return
        if not self._is_ours(address, now):
            return
        self.state = reduce(self.state, message, now)
        self.seen_at[type(message)] = now
        if isinstance(message, Heartbeat):
            self.on_heartbeat()
        elif isinstance(message, CommandAck):
            self.on_ack(message)
        elif isinstance(message, StatusTextMessage):
            self._say(self._joiner.feed(message, now))
        elif isinstance(message, Event):
            self._happened(message, now)
        self._pass_on(message)
        self._wake()

    def handle_component_message(self, component: int, message: MavlinkMessage) -> None:
        """Process a message of another component of the vehicle: a camera, or a gimbal."""
        if isinstance(message, GimbalDeviceAttitudeStatus | OpenDroneIdArmStatus):
            self.state = reduce(self.state, message, self.now())
            self._wake()
        elif component in CAMERAS:
            camera = self.camera
            if camera is None and isinstance(message, Heartbeat) and message.type == CAMERA_TYPE:
                camera = self.camera = VehicleComponent(self, component)
            if camera is not None and camera.component == component:
                camera.handle_message(message, None)

    def _is_ours(self, address: Address, now: float) -> bool:
        """Return True if an address is the vehicle's; learn a new one after 3 s of silence of the old one.

        If the known address stays active beside another one, that is a second vehicle with the same id; if
        not, the autopilot restarted with a new address. Of several links the first on which the vehicle is
        heard is used; the others stand by.
        """
        link = link_index_of(address)
        known, heard_at = self._addresses_by_link.get(link, (address, -math.inf))
        if now - heard_at > SILENCE:
            known = address
        elif address != known:
            self._others.setdefault(link, deque(maxlen=_REMEMBERED)).append((address, now))
            return False
        elif link in self._others:
            self._clash(self._others[link])
        self._others.pop(link, None)
        self._addresses_by_link[link] = known, now
        best = link
        if len(self._addresses_by_link) > 1:
            best = min(each for each, (_, at) in self._addresses_by_link.items() if now - at <= _SWITCH_AFTER)
        if best != link_index_of(self.address):
            self.log.info("it is reached by way %s from now on", best)
            self.switches += 1
        self.address = self._addresses_by_link[best][0]
        return link == best

    def _clash(self, others: deque[tuple[Address, float]]) -> None:
        """Record that a second vehicle uses this id, with the addresses and times of its messages."""
        other, at = others[-1]
        if not self.clashing:
            self.log.error("two vehicles use id %s: at %s and %s", self.system, self.address, other)
        self._clash_at = at
        self.trust.counts["messages of a second vehicle with this id"] += len(others)

    @contextlib.contextmanager
    def hearing(self, *kinds: type[SaidT]) -> Iterator[ReceivedMessages[SaidT]]:
        """Collect its messages of some types, for an exchange that needs each of them."""
        heard = ReceivedMessages(kinds)
        self._hearing.append(heard)
        try:
            yield heard
        finally:
            self._hearing.remove(heard)

    def tick(self) -> None:
        """Pass on texts whose last chunks never arrived."""
        self._say(self._joiner.late(self.now()))

    def _happened(self, event: Event, now: float) -> None:
        """Pass on an event as text, once."""
        said = self.dictionary.say(event) if self.dictionary and event.sequence != self._event else None
        self._event = event.sequence
        if said is not None:
            self._say([Sentence(said.text, said.severity, now, event=True)])

    def _say(self, sentences: list[Sentence]) -> None:
        """Store texts and pass them on, except repeats of an event in fewer words."""
        for sentence in sentences:
            if _is_repeated(sentence, self.sentences):
                continue
            self.sentences.append(sentence)
            self.on_sentence(sentence)
            self._pass_on(sentence)

    def _pass_on(self, said: MavlinkMessage | Sentence) -> None:
        """Give a message to the queues that collect it."""
        for heard in self._hearing:
            heard.put(said)

    def _wake(self) -> None:
        """Wake the tasks whose condition has become true."""
        for condition, future in self._waiting:
            if not future.done() and condition(self.state):
                future.set_result(None)

    async def restarted(self, reboots: int, seconds: float) -> None:
        """Wait until it has restarted more than ``reboots`` times, ``seconds`` at most."""
        await self.until(lambda state: state.reboots > reboots, seconds)

    async def until(self, condition: StateCondition, seconds: float) -> bool:
        """Wait until the state meets a condition; return whether it did in time."""
        if condition(self.state):
            return True
        waiter = (condition, asyncio.get_running_loop().create_future())
        self._waiting.append(waiter)
        try:
            async with asyncio.timeout(seconds):
                await waiter[1]
        except TimeoutError:
            return condition(self.state)  # it may have become true at the timeout itself
        finally:
            self._waiting.remove(waiter)
        return True


def vehicle_text(heartbeat: Heartbeat) -> str:
    """Return type and autopilot of a vehicle, as text."""
    return f"a {type_name(heartbeat.type)} on {kind_of(heartbeat).name}"


def not_moved(heartbeat: Heartbeat) -> str:
    """Return the text for a vehicle that is not moved here."""
    why = PX4_ROVER if heartbeat.autopilot == PX4 and heartbeat.type in ROVERS else ""
    return f"it is {vehicle_text(heartbeat)}, which is not moved here: it is watched, and stopped{why}"


def circle_of(state: VehicleState) -> float:
    """Return the radius in metres within which a vehicle circles its goal; 0 for one that stands."""
    flavour = flavour_of(state.heartbeat, state) if state.heartbeat else None
    if flavour is None:
        return 0.0
    flies_so = state.in_air and not flavour.stands(state)
    wings = flavour.forward if flavour.forward is not None and flies_so else flavour
    return wings.reach(state) if isinstance(wings, Winged) else 0.0


def missing_commands(state: VehicleState) -> Mapping[str, str]:
    """Return the commands that a vehicle lacks, with reasons; none before its first heartbeat."""
    heartbeat = state.heartbeat
    if heartbeat is None:
        return {}
    flavour = flavour_of(heartbeat, state)
    return dict.fromkeys(OF_A_MOVED_VEHICLE, not_moved(heartbeat)) if flavour is None else flavour.lacking


class VehicleComponent(Vehicle):
    """A component beside the autopilot with its own commands; it is reached like its vehicle."""

    def __init__(self, whole: Vehicle, component: int) -> None:
        super().__init__(whole.system, whole.clock, lambda message, _address: whole.send(message))
        self.component = component

    def handle_message(self, message: MavlinkMessage, address: Address) -> None:  # noqa: ARG002 - its vehicle's is used
        """Process a message of the component."""
        self.state = reduce(self.state, message, self.now())
        if isinstance(message, CommandAck):
            self.on_ack(message)
        self._pass_on(message)
        self._wake()


def _is_repeated(sentence: Sentence, said: Iterable[Sentence]) -> bool:
    """Return True if an event and a text with the same content follow each other."""
    return any(
        sentence.at - each.at <= _SAME_WITHIN
        and sentence.event is not each.event
        and each.text.startswith(sentence.text)
        for each in said
    )


def _nothing() -> None:
    """Do nothing."""


def _ignore(_said: object) -> None:
    """Do nothing."""


def holding_of(vehicle: Vehicle) -> Brake | None:
    """Return the best way to brake a vehicle, None for one that is not controlled here.

    Without a connection, position and flight state count as unknown: the vehicle may have moved since.
    """
    state = vehicle.state
    if not vehicle.connected:
        flies = 0 if state.vtol_state == 0 else None
        state = msgspec.structs.replace(state, vtol_state=flies, position_at=-math.inf)
    flavour = flavour_of(state.heartbeat, state) if state.heartbeat else None
    return flavour.holding(state) if flavour else None
