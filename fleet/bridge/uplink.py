"""From the bus to the cloud: the newest of each state at its rate, every event in order, translated.

Events are translated and published as they come, on whatever thread brings them. Of state the newest is
stored, and what is due published once a turn of the wheel; that of this process's own robots, if it is due,
at once. How often, how large and whether at all is in the twin's rulebook.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from functools import partial

import msgspec

from fleet.bridge.counters import ClassCounts
from fleet.clock import Clock
from fleet.errors import WireError
from fleet.model.report import Report
from fleet.tally import Tally
from fleet.wire.databus import decode_report
from fleet.wire.documents import document_out
from fleet.wire.reports import to_mqtt
from fleet.wire.rulebook import Rulebook
from fleet.wire.rules import Form, Rule, Traffic
from fleet.wire.topics import Topics, parse_data_key

log = logging.getLogger(__name__)

SLACK = (
    0.001  # s by which a message may be early, so that a source of just its rate does not lose every other
)
STEP = 4  # samples in one step of a turn: less would cost more than the samples
REPEAT_LOOK = 0.2  # s between looks for what must be repeated
STRANGERS = 10_000  # keys that are remembered as not ours; anybody on the bus can invent more
TELL_EVERY = 10.0  # s between warnings of dropped events

Send = Callable[[bytes], object]
OpenWay = Callable[[str, Rule], Send]
"""How the uplink publishes: a topic is opened by its rule, once, and what is returned takes payloads."""


class TwinInfo(msgspec.Struct, frozen=True):
    """What the uplink knows of a twin: its robot's name, the source type of its state, and its rules."""

    robot: str
    source_type: str
    rules: Rulebook


class _Slot:
    """One channel of one twin: how it is carried, its newest sample, and when it may go."""

    __slots__ = (  # four for each robot, all looked at many times a second
        "channel",
        "credit",
        "document",
        "due",
        "durable",
        "fresh",
        "info",
        "period",
        "rate",
        "refused",
        "repeat",
        "rule",
        "sample",
        "sensor",
        "sent",
        "size",
        "streams",
        "traffic",
        "twin",
        "ways",
    )

    def __init__(self, twin: str, info: TwinInfo, channel: str, sensor: str | None, rule: Rule) -> None:
        self.twin = twin
        self.info = info
        self.channel = channel
        self.sensor = sensor
        self.rule = rule
        self.document = rule.form is Form.DOCUMENT
        self.traffic = int(rule.traffic)
        self.size = rule.size
        self.ways: dict[str, Send] = {}  # by leaf
        self.durable = rule.traffic.durable
        self.streams = rule.traffic is Traffic.STREAM
        self.rate = rule.max_rate
        self.period = 1.0 / rule.max_rate - SLACK if rule.max_rate else 0.0
        self.repeat = 1.0 / rule.repeat if rule.repeat else 0.0
        self.sample: Report | bytes = b""
        self.fresh = False
        self.sent = float("-inf")
        self.due = float("-inf")  # when the next one may go
        self.credit = 0.0  # events that may go now
        self.refused = False  # the last sample could not be translated

    def takes_event(self, now: float) -> bool:
        """Return False for an event above the channel's rate; the events of one second may come at once.

        Two threads that bring events of one channel at once may let one too many or too few pass.
        """
        self.credit = min(max(self.rate, 1.0), self.credit + (now - self.sent) * self.rate)
        self.sent = now
        if self.credit < 1.0:
            return False
        self.credit -= 1.0
        return True

    def goes(self, now: float) -> None:
        """Note that its newest sample goes.

        One that was late does not put off those behind it: that would add up, and now and then lose one.
        """
        self.sent = now
        self.due = max(self.due + self.period, now + self.period / 2)

    @property
    def leaf(self) -> str:
        """The leaf of a document; the sensor takes its place in it, or comes behind it."""
        if "+" in self.rule.leaf:
            return self.rule.leaf.replace("+", self.sensor or "")
        return f"{self.rule.leaf}/{self.sensor}" if self.sensor else self.rule.leaf


class Uplink:
    """The bus-to-cloud half of the bridge.

    ``session`` is stamped on every payload. ``alive`` tells whether a robot answers, so that only what is
    still true is repeated. ``waiting`` tells how many bytes wait to be sent: streams are dropped first.
    ``full`` tells that the network does not take them: of state the newest waits here until it does.
    ``held`` holds the twins that another edge has: nothing is said of them.
    """

    def __init__(
        self,
        topics: Topics,
        twins: Mapping[str, TwinInfo],
        *,
        session: str,
        open_way: OpenWay,
        alive: Callable[[str], bool],
        waiting: Callable[[], int],
        full: Callable[[], bool],
        refusals: Tally,
        clock: Clock,
    ) -> None:
        self._topics = topics
        self._twins = twins
        self._session = session
        self._open_way = open_way
        self._alive = alive
        self._waiting = waiting
        self._full = full
        self._held_up = False  # the way was full at the last turn
        self._clock = clock
        self._slots: dict[str, _Slot | None] = {}
        self._repeated: list[_Slot] = []
        # Filled on the bus's threads and emptied on the loop, each step atomic: nothing is ever swapped.
        self._fresh: deque[_Slot] = deque()
        self._next_repeat = float("-inf")
        self._next_tell = float("-inf")
        self._told = 0
        self.held: frozenset[str] = frozenset()
        self.refusals = refusals
        self.received = ClassCounts()
        self.sent = ClassCounts()
        self.conflated = ClassCounts()
        self.dropped = ClassCounts()

    @property
    def waiting(self) -> int:
        """How many samples wait for their turn."""
        return len(self._fresh)

    def arrived(self, key: str, sample: bytes) -> None:
        """Take a sample from the bus; any thread, never blocks."""
        slot = self._slots[key] if key in self._slots else self._meet(key)
        if slot is not None:
            self._take(slot, sample)

    def crossing(self, key: str) -> Callable[[Report], None] | None:
        """Return what takes this process's own reports of a key, on the loop; None when none may cross.

        A state that is due crosses there and then, while it is at hand.
        """
        slot = self._slots[key] if key in self._slots else self._meet(key)
        if slot is None:
            return None
        return partial(self._take if slot.durable or slot.streams else self._take_state, slot)

    def _take_state(self, slot: _Slot, report: Report) -> None:
        """Take a state of a robot of this process."""
        now = self._clock.monotonic()
        if slot.fresh or self._held_up or now < slot.due:
            self._take(slot, report)
            return
        self.received.counts[slot.traffic] += 1
        slot.sample = report
        slot.goes(now)
        self._send(slot, report)

    def _take(self, slot: _Slot, sample: Report | bytes) -> None:
        """Take a sample: an event crosses at once, of a state the newest is kept for the turn."""
        self.received.counts[slot.traffic] += 1
        if slot.durable:
            if not slot.rate or slot.takes_event(self._clock.monotonic()):
                self._send(slot, sample)
            else:
                self.dropped.add(slot.rule.traffic)
            return
        slot.sample = sample
        if slot.fresh:
            self.conflated.counts[slot.traffic] += 1
        else:
            slot.fresh = True
            self._fresh.append(slot)

    def turn(self) -> Iterator[None]:
        """Publish the state that is due, a few samples a step."""
        now = self._clock.monotonic()
        self._held_up = self._full()
        yield from self._send_newest(now)
        if now >= self._next_repeat:
            self._next_repeat = now + REPEAT_LOOK
            if not self._held_up:
                yield from self._repeat(now)
            self._tell_dropped(now)

    def say_newest(self) -> None:
        """Publish now what is true of the robots that answer, whatever was sent before."""
        now = self._clock.monotonic()
        for slot in self._repeated:
            if slot.sample and not slot.refused and self._alive(slot.info.robot):
                slot.goes(now)
                self._send(slot, slot.sample)

    def _send_newest(self, now: float) -> Iterator[None]:
        """Send the newest of each state that is due; a stream only while the way is free."""
        waiting = self._waiting() if self._fresh else 0
        for number in range(len(self._fresh)):
            slot = self._fresh.popleft()
            if now < slot.due or (self._held_up and not slot.streams):
                self._fresh.append(slot)
                continue
            slot.fresh = False
            if slot.streams and (self._held_up or waiting >= slot.info.rules.backlog):
                self.dropped.add(slot.rule.traffic)
                continue
            slot.goes(now)
            self._send(slot, slot.sample)
            if not number % STEP:
                yield

    def _tell_dropped(self, now: float) -> None:
        """Warn of events that were lost since the last warning."""
        durable = self.dropped.durable
        lost = durable - self._told
        if lost and now >= self._next_tell:
            self._told, self._next_tell = durable, now + TELL_EVERY
            log.warning("%d events came faster than they may cross to the cloud and were dropped", lost)

    def _repeat(self, now: float) -> Iterator[None]:
        """Say again what has not changed for long: a reader cannot tell a parked robot from a gone one."""
        for slot in self._repeated:
            # Rather early than late: a parked robot's messages are never farther apart than 1 / repeat.
            early = max(slot.repeat - 1.5 * REPEAT_LOOK, slot.period)
            due = slot.sample and not slot.refused and now - slot.sent >= early
            if due and self._alive(slot.info.robot):
                slot.goes(now)
                self._send(slot, slot.sample)
                yield

    def _send(self, slot: _Slot, sample: Report | bytes) -> None:
        """Translate one sample and publish what it becomes."""
        if slot.twin in self.held:
            return
        try:
            messages = self._translated(slot, sample)
        except WireError as error:
            slot.refused = True
            line = "a sample on %s of %s did not cross: %s"
            self.refusals.add("unreadable", line, slot.channel, slot.twin, error)
            return
        slot.refused = False
        for leaf, payload in messages:
            if len(payload) > slot.size:
                line = "%s of %s: %d bytes are more than the %d of its rule"
                self.refusals.add("too large", line, leaf, slot.twin, len(payload), slot.size)
                continue
            self.sent.counts[slot.traffic] += 1
            (slot.ways.get(leaf) or self._open(slot, leaf))(payload)

    def _translated(self, slot: _Slot, sample: Report | bytes) -> list[tuple[str, bytes]]:
        """Return leaf and payload of each message that a sample becomes; raises WireError."""
        twin = slot.info
        if slot.document:
            assert isinstance(sample, bytes)
            leaf = slot.leaf
            payload = document_out(leaf, sample, source_type=twin.source_type, session=self._session)
            return [(leaf, payload)]
        return to_mqtt(
            decode_report(slot.channel, sample) if isinstance(sample, bytes) else sample,
            source_type=twin.source_type,
            session=self._session,
            sensor=slot.sensor,
            off=twin.rules.off,
        )

    def _open(self, slot: _Slot, leaf: str) -> Send:
        """Open the way to a topic, once."""
        way = slot.ways[leaf] = self._open_way(self._topics.twin(slot.twin, leaf), slot.rule)
        return way

    def _meet(self, key: str) -> _Slot | None:
        """Decide what a key is, once: a slot of ours, or None for what does not cross."""
        parsed = parse_data_key(key)
        twin = self._twins.get(parsed.twin) if parsed else None
        rule = twin.rules.outward.get(parsed.channel) if parsed and twin else None
        # What a worker learned with one of a robot's sensors is seldom the robot's own state.
        if parsed is None or twin is None or rule is None or (parsed.sensor is not None and not rule.sensors):
            return self._slots.setdefault(key, None) if len(self._slots) < STRANGERS else None
        if parsed.sensor is not None and len(self._slots) >= STRANGERS:
            return None
        slot = _Slot(parsed.twin, twin, parsed.channel, parsed.sensor, rule)
        kept = self._slots.setdefault(key, slot)
        if kept is slot and slot.repeat:
            self._repeated.append(slot)
        return kept
