"""From the bus to the cloud: the newest of each state at its rate, every event in order, translated.

``arrived`` runs on the bus's threads and only stores. Once a turn of the wheel ``turn`` decodes, translates
and publishes what is due, and the cloud's writer sends it all at once.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterator, Mapping

import msgspec

from fleet.errors import WireError
from fleet.model.report import Report
from fleet.wire.databus import decode_report
from fleet.wire.reports import to_mqtt
from fleet.wire.rules import Rule, rule_of, rule_of_channel
from fleet.wire.topics import Topics, parse_data_key

log = logging.getLogger(__name__)

REPEAT_LOOK = 0.2  # s between looks for what must be repeated
WAITING = 5000  # events that wait for a turn of the wheel; beyond it the oldest is dropped, counted
STRANGERS = 10_000  # keys that are remembered as not ours; anybody on the bus can invent more
TELL_EVERY = 10.0  # s between warnings of dropped events

Publish = Callable[[str, bytes, int], object]
"""How the uplink publishes: topic, payload, QoS."""


class TwinInfo(msgspec.Struct, frozen=True):
    """What the uplink knows of a twin: its robot's name and the source type of its state."""

    robot: str
    source_type: str


class _Slot:
    """One channel of one twin: how it is carried, its newest sample, and when it may go."""

    def __init__(self, twin: str, channel: str, rule: Rule) -> None:
        self.twin = twin
        self.channel = channel
        self.durable = rule.traffic.durable
        self.rate = rule.max_rate
        self.period = 1.0 / rule.max_rate if rule.max_rate else 0.0
        self.repeat = 1.0 / rule.repeat if rule.repeat else 0.0
        self.sample: Report | bytes = b""
        self.fresh = False
        self.sent = float("-inf")
        self.credit = 0.0  # events that may go now
        self.refused = False  # the last sample could not be translated

    def takes_event(self, now: float) -> bool:
        """Return False for an event above the channel's rate; the events of one second may come at once."""
        if not self.rate:
            return True
        self.credit = min(self.rate, self.credit + (now - self.sent) * self.rate)
        self.sent = now
        if self.credit < 1.0:
            return False
        self.credit -= 1.0
        return True


class Uplink:
    """The bus-to-cloud half of the bridge.

    ``session`` is stamped on every payload. ``alive`` tells whether a robot answers, so that only what is
    still true is repeated.
    """

    def __init__(
        self,
        topics: Topics,
        twins: Mapping[str, TwinInfo],
        *,
        session: str,
        publish: Publish,
        alive: Callable[[str], bool],
    ) -> None:
        self._topics = topics
        self._twins = twins
        self._session = session
        self._publish = publish
        self._alive = alive
        self._slots: dict[str, _Slot | None] = {}
        self._repeated: list[_Slot] = []
        # Filled on the bus's threads and emptied on the loop, each step atomic: nothing is ever swapped.
        self._fresh: deque[_Slot] = deque()
        self._events: deque[tuple[_Slot, Report | bytes]] = deque(maxlen=WAITING)
        self._next_repeat = float("-inf")
        self._next_tell = float("-inf")
        self._told = 0
        self._topic_cache: dict[tuple[str, str], tuple[str, int]] = {}
        self.received = 0
        self.conflated = 0
        self.dropped = 0
        self.refused = 0

    def arrived(self, key: str, sample: Report | bytes) -> None:
        """Take a sample from the bus, or a report of this process; any thread, never blocks."""
        slot = self._slots[key] if key in self._slots else self._meet(key)
        if slot is None:
            return
        self.received += 1
        if not slot.durable:
            slot.sample = sample
            if slot.fresh:
                self.conflated += 1
            else:
                slot.fresh = True
                self._fresh.append(slot)
            return
        if len(self._events) == WAITING:
            self.dropped += 1
        self._events.append((slot, sample))

    def turn(self, now: float) -> Iterator[None]:
        """Publish what is due at the monotonic time ``now``, one sample a step."""
        for _ in range(len(self._events)):
            slot, sample = self._events.popleft()
            if slot.takes_event(now):
                self._send(slot, sample)
                yield
            else:
                self.dropped += 1
        for _ in range(len(self._fresh)):
            slot = self._fresh.popleft()
            if now - slot.sent >= slot.period:
                slot.fresh = False
                slot.sent = now
                self._send(slot, slot.sample)
                yield
            else:
                self._fresh.append(slot)
        if now >= self._next_repeat:
            self._next_repeat = now + REPEAT_LOOK
            yield from self._repeat(now)
            self._tell_dropped(now)

    def say_newest(self, now: float) -> None:
        """Publish now what is true of the robots that answer, whatever was sent before."""
        for slot in self._repeated:
            if slot.sample and not slot.refused and self._alive(self._twins[slot.twin].robot):
                slot.sent = now
                self._send(slot, slot.sample)

    def _tell_dropped(self, now: float) -> None:
        """Warn of events that were lost since the last warning."""
        lost = self.dropped - self._told
        if lost and now >= self._next_tell:
            self._told, self._next_tell = self.dropped, now + TELL_EVERY
            log.warning("%d events came faster than they may cross to the cloud and were dropped", lost)

    def _repeat(self, now: float) -> Iterator[None]:
        """Say again what has not changed for long: a reader cannot tell a parked robot from a gone one."""
        for slot in self._repeated:
            due = slot.sample and not slot.refused and now - slot.sent >= slot.repeat - REPEAT_LOOK / 2
            if due and self._alive(self._twins[slot.twin].robot):
                slot.sent = now
                self._send(slot, slot.sample)
                yield

    def _send(self, slot: _Slot, sample: Report | bytes) -> None:
        """Translate one sample and publish what it becomes."""
        try:
            report = decode_report(slot.channel, sample) if isinstance(sample, bytes) else sample
            source_type = self._twins[slot.twin].source_type
            messages = to_mqtt(report, source_type=source_type, session=self._session)
        except WireError as error:
            self.refused += 1
            if not slot.refused:  # the first of a row is told, all are counted
                slot.refused = True
                log.warning(
                    "a %s sample of %s did not cross to the cloud: %s", slot.channel, slot.twin, error
                )
            return
        slot.refused = False
        for leaf, payload in messages:
            topic, qos = self._topic_cache.get((slot.twin, leaf)) or self._topic(slot.twin, leaf)
            self._publish(topic, payload, qos)

    def _topic(self, twin: str, leaf: str) -> tuple[str, int]:
        """Work out a topic and its QoS, once."""
        rule = rule_of(leaf)
        entry = (self._topics.twin(twin, leaf), rule.qos if rule else 0)
        self._topic_cache[(twin, leaf)] = entry
        return entry

    def _meet(self, key: str) -> _Slot | None:
        """Decide what a key is, once: a slot of ours, or None for what does not cross."""
        parsed = parse_data_key(key)
        rule = rule_of_channel(parsed.channel) if parsed else None
        # What a worker learned with one of a robot's sensors is not the robot's own state.
        if parsed is None or rule is None or parsed.sensor is not None or parsed.twin not in self._twins:
            return self._slots.setdefault(key, None) if len(self._slots) < STRANGERS else None
        slot = _Slot(parsed.twin, parsed.channel, rule)
        kept = self._slots.setdefault(key, slot)
        if kept is slot and slot.repeat:
            self._repeated.append(slot)
        return kept
