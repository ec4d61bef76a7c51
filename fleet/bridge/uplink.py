"""From the bus to the cloud: the newest sample of each state at its rate, every event in order.

Events are translated and published on the thread on which they arrive. Of a state the newest sample is
stored, and published once it is due, at the end of a tick; small due states of this process's own robots are
published immediately. The rulebook of the twin decides rates, sizes, and which channels are forwarded.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Protocol

from fleet.bridge.counters import ClassCounts
from fleet.bridge.event_limits import EventLimits
from fleet.bridge.outbound_channel import REPEAT_CHECK, OutboundChannel, TwinInfo, is_left_out
from fleet.clock import Clock
from fleet.cloud.client import PublishRoute
from fleet.errors import WireError
from fleet.model.event import EventReport
from fleet.model.report import Report
from fleet.runtime.rate_limited_counter import RateLimitedCounter
from fleet.wire.databus import decode_report, unread_fields
from fleet.wire.documents import document_out
from fleet.wire.events import CLOUD_EVENTS, is_fleet_event, unproven
from fleet.wire.reports import to_mqtt
from fleet.wire.rules import TopicRule
from fleet.wire.sub_states import is_telemetry_end, part_of
from fleet.wire.topics import Topics, data_key, parse_data_key

log = logging.getLogger(__name__)

STEP = 8  # samples in one step of a tick
CHECKS = 100  # channels checked for repetition in one step
MOST_KEYS = 10_000  # bound of the remembered keys: any program on the bus can create more
WARN_EVERY = 10.0  # s between warnings of dropped events

OpenRoute = Callable[[str, TopicRule], PublishRoute]
"""Returns the publish route of a topic with its rule; called once for each topic."""


class Client(Protocol):
    """Queue of payloads with their routes; they are sent at the end of the tick."""

    def queue(self, route: PublishRoute, payload: bytes) -> None:
        """Queue one payload."""


class Uplink:
    """The bus-to-cloud half of the bridge.

    ``session`` is put into every payload. ``alive`` returns whether a robot answers: only then its state is
    repeated. ``waiting`` returns the number of bytes that wait to be sent: streams are dropped first.
    ``full`` returns whether the network accepts no more data: the newest sample of each state then waits
    here. ``held`` has the twins that another edge holds: nothing of them is published.
    """

    def __init__(
        self,
        topics: Topics,
        twins: Mapping[str, TwinInfo],
        *,
        session: str,
        open_route: OpenRoute,
        client: Client,
        alive: Callable[[str], bool],
        waiting: Callable[[], int],
        full: Callable[[], bool],
        refusals: RateLimitedCounter,
        clock: Clock,
    ) -> None:
        self._topics = topics
        self._twins = twins
        self._session = session
        self._open_route = open_route
        self._client = client
        self._alive = alive
        self._waiting = waiting
        self._full = full
        self._held_up = False  # the network was full at the last tick
        self._backlog = 0  # bytes that waited to be sent at the last tick
        self._clock = clock
        self._channels: dict[str, OutboundChannel | None] = {}
        self._repeated: list[OutboundChannel] = []
        # Filled on threads of the bus, emptied on the loop, each step atomic: never replace the deque.
        self._fresh: deque[OutboundChannel] = deque()
        self._next_repeat = float("-inf")
        self._next_warning = float("-inf")
        self._warned = 0
        self.held: frozenset[str] = frozenset()
        self.streaming: set[str] = set()  # twins with video streams of a program on the bus
        self.refusals = refusals
        self.events = EventLimits()
        self.received = ClassCounts()
        self.sent = ClassCounts()
        self.conflated = ClassCounts()
        self.dropped = ClassCounts()

    @property
    def waiting(self) -> int:
        """The number of samples that wait for a later tick."""
        return len(self._fresh)

    def arrived(self, key: str, sample: bytes) -> None:
        """Handle a sample from the bus; any thread, never blocks."""
        try:
            outbound = self._channels[key]  # a single lookup: another thread may remove it
        except KeyError:
            outbound = self._resolve(key)
            if outbound is not None and not outbound.document:
                _report_unread(outbound, sample, self.refusals)
        if outbound is None:
            return
        if outbound.ours and (not outbound.shared or is_fleet_event(sample, outbound.channel)):
            line = "refused %s of %s from the bus: its robot runs in this process and reports it itself"
            self.refusals.add("forged", line, outbound.channel, outbound.twin)
            return
        self._handle(outbound, sample)

    def open(self, key: str) -> OutboundChannel | None:
        """Return the outbound channel of this process's own reports of a key; None if it is not forwarded.

        From then on, samples of other programs on the key are refused: only this process reports the state of
        its robots. Other programs may still publish their own events, but none in the format of the fleet.
        """
        try:
            outbound = self._channels[key]
        except KeyError:
            outbound = self._resolve(key)
        if outbound is not None:
            outbound.ours = True
        return outbound

    def drop(self, twin: str) -> None:
        """Forget the channels of a twin after its robot was removed or replaced; on the loop."""
        begin = f"cw/{twin}/"
        for key in [key for key in list(self._channels) if key.startswith(begin)]:
            outbound = self._channels.pop(key)
            if outbound is None:
                continue
            outbound.drop()
            if outbound in self._repeated:
                self._repeated.remove(outbound)
        self.streaming.discard(twin)

    def refuse_bus_events(self, twins: Iterable[str]) -> None:
        """Refuse events in the format of the fleet from the bus for robots that run in this process."""
        for twin in twins:
            self.open(data_key(twin, EventReport.channel))

    def forward(self, batch: Sequence[tuple[OutboundChannel, Report]]) -> None:
        """Forward this process's own reports, each with its outbound channel; on the loop.

        Small reports that are due are sent immediately instead of queued for the tick.
        """
        now, held_up, backlog = self._clock.monotonic(), self._held_up, self._backlog
        for outbound, report in batch:
            waits = outbound.fresh or held_up or (outbound.streams and backlog >= outbound.backlog)
            if outbound.at_once and now >= outbound.due and not waits:
                self.received.counts[outbound.traffic] += 1
                outbound.sample = report
                outbound.mark_sent(now)
                self._send(outbound, report)
            else:
                self._handle(outbound, report)

    def _handle(self, outbound: OutboundChannel, sample: Report | bytes) -> None:
        """Send an event immediately; of a state keep the newest sample for the tick."""
        if outbound.parted:
            try:
                outbound, sample = self._part(outbound, sample)
            except WireError as error:
                self.received.counts[outbound.traffic] += 1
                self._refuse(outbound, error)
                return
        self.received.counts[outbound.traffic] += 1
        if (
            outbound.durable
            and outbound.channel == EventReport.channel
            and self._forward_event(outbound, sample)
        ):
            return
        if outbound.durable:
            if not outbound.rate or outbound.admits_event(self._clock.monotonic()):
                self._send(outbound, sample)
            else:
                self.dropped.add(outbound.rule.traffic)
            return
        outbound.sample = sample
        if outbound.fresh:
            self.conflated.counts[outbound.traffic] += 1
        else:
            outbound.fresh = True
            self._fresh.append(outbound)

    def _part(self, outbound: OutboundChannel, sample: Report | bytes) -> tuple[OutboundChannel, Report]:
        """Return channel and report of one part of a channel with several states; raises WireError."""
        report = decode_report(outbound.channel, sample) if isinstance(sample, bytes) else sample
        if is_telemetry_end(report) and outbound.twin in self.streaming:
            raise WireError("a program here has streams of this twin, which it would close; name a sensor")
        return outbound.part(part_of(report)), report

    def _forward_event(self, outbound: OutboundChannel, sample: Report | bytes) -> bool:
        """Send an event of the fleet unless it is suppressed; False for an event of another program."""
        heard = sample if isinstance(sample, bytes) else None
        if isinstance(sample, bytes):
            if not is_fleet_event(sample, outbound.channel):
                return False
            try:
                sample = decode_report(outbound.channel, sample)
            except WireError:  # handled like any other invalid document
                return False
        if isinstance(sample, EventReport) and sample.kind in CLOUD_EVENTS:
            topic = self._topics.twin(outbound.twin, outbound.rule.suffix)
            now, wall = self._clock.monotonic(), self._clock.time()
            if self.events.admits(topic, sample, now, wall, heard=heard is not None):
                self._send(outbound, heard or sample)
        return True

    def tick(self) -> Iterator[None]:
        """Publish the state that is due, a few samples in each step."""
        now = self._clock.monotonic()
        self._held_up, self._backlog = self._full(), self._waiting()
        yield from self._send_newest(now)
        if now >= self._next_repeat:
            self._next_repeat = now + REPEAT_CHECK
            if not self._held_up:
                yield from self._repeat(now)
            self._warn_of_drops(now)

    def publish_newest(self) -> None:
        """Publish the newest repeated state of all robots that answer, even if it was sent before."""
        now = self._clock.monotonic()
        for outbound in self._repeated:
            if outbound.sample and not outbound.refused and self._alive(outbound.info.robot):
                outbound.mark_sent(now)
                self._send(outbound, outbound.sample)

    def _send_newest(self, now: float) -> Iterator[None]:
        """Send the newest sample of each due state; of a stream only while the network accepts data."""
        for number in range(1, len(self._fresh) + 1):
            outbound = self._fresh.popleft()
            if self._may_send(outbound, now):
                self._send(outbound, outbound.sample)
            if outbound.heavy or not number % STEP:
                yield

    def _may_send(self, outbound: OutboundChannel, now: float) -> bool:
        """Return whether to send the newest sample now; otherwise it stays queued, or is dropped."""
        if outbound.dropped:
            return False
        if now < outbound.due or (self._held_up and not outbound.streams):
            self._fresh.append(outbound)
            return False
        outbound.fresh = False
        if outbound.streams and (self._held_up or self._backlog >= outbound.backlog):
            self.dropped.add(outbound.rule.traffic)
            return False
        outbound.mark_sent(now)
        return True

    def _warn_of_drops(self, now: float) -> None:
        """Log events that were dropped since the last warning."""
        durable = self.dropped.durable
        lost = durable - self._warned
        if lost and now >= self._next_warning:
            self._warned, self._next_warning = durable, now + WARN_EVERY
            log.warning("dropped %d events above the permitted rate to the cloud", lost)

    def _repeat(self, now: float) -> Iterator[None]:
        """Repeat unchanged state: otherwise a parked robot looks like a lost one to a subscriber."""
        for number, outbound in enumerate(self._repeated):
            silent = now - outbound.sent >= outbound.silence
            if silent and outbound.sample and not outbound.refused and self._alive(outbound.info.robot):
                outbound.mark_sent(now)
                self._send(outbound, outbound.sample)
                yield
            elif not number % CHECKS:
                yield

    def _send(self, outbound: OutboundChannel, sample: Report | bytes) -> None:
        """Translate and publish one sample; an error in it affects no other sample."""
        if outbound.twin in self.held or outbound.twin not in self._twins:
            return
        try:
            messages = _translated(outbound, sample, self._session)
            outbound.refused = False
            for suffix, payload in messages:
                self._queue(outbound, suffix, payload)
        except WireError as error:
            self._refuse(outbound, error)
        except Exception as error:  # noqa: BLE001 - exception barrier: other robots go on
            outbound.refused = True
            line = "a sample on %s of %s was not forwarded: %s"
            self.refusals.add("failed", line, outbound.channel, outbound.twin, repr(error))

    def _queue(self, outbound: OutboundChannel, suffix: str, payload: bytes) -> None:
        """Queue one message; the route of its topic is cached."""
        if len(payload) > outbound.size:
            line = "%s of %s: %d bytes are more than the %d of its rule"
            self.refusals.add("too large", line, suffix, outbound.twin, len(payload), outbound.size)
            return
        route = outbound.routes.get(suffix)
        if route is None:
            route = outbound.routes[suffix] = self._open_route(
                self._topics.twin(outbound.twin, suffix), outbound.rule
            )
        self.sent.counts[outbound.traffic] += 1
        self._client.queue(route, payload)

    def _refuse(self, outbound: OutboundChannel, error: WireError) -> None:
        """Count a sample that cannot be forwarded, with the reason."""
        outbound.refused = True
        line = "a sample on %s of %s was not forwarded: %s"
        self.refusals.add("unreadable", line, outbound.channel, outbound.twin, error)

    def _resolve(self, key: str) -> OutboundChannel | None:
        """Return the channel of a new key, None if it is not forwarded; the result is cached."""
        parsed = parse_data_key(key)
        twin = self._twins.get(parsed.twin) if parsed else None
        rule = twin.rules.outward.get(parsed.channel) if parsed and twin else None
        # A program's result from one sensor of a robot is seldom the state of the robot itself.
        if parsed is None or twin is None or rule is None or (parsed.sensor is not None and not rule.sensors):
            if parsed and twin and is_left_out(parsed):
                line = "%.120s stays on the bus: no rule forwards it (cloud.channels in fleet.yaml adds one)"
                self.refusals.add("no rule", line, key)
            return self._channels.setdefault(key, None) if len(self._channels) < MOST_KEYS else None
        if parsed.sensor is not None and len(self._channels) >= MOST_KEYS:
            return None
        outbound = OutboundChannel(parsed, twin, rule, self._session)
        if parsed.channel.startswith("webrtc_"):
            self.streaming.add(parsed.twin)
        kept = self._channels.setdefault(key, outbound)
        if kept is outbound and outbound.repeat:
            self._repeated.append(outbound)
        return kept


def _report_unread(outbound: OutboundChannel, sample: bytes, refusals: RateLimitedCounter) -> None:
    """Report the fields of a program's message that are not forwarded; for the first message of a key."""
    unread = unread_fields(outbound.channel, sample)
    if unread:
        line = "%s of %s: these fields are not forwarded: %s"
        refusals.add("unknown fields", line, outbound.channel, outbound.twin, ", ".join(unread)[:200])


def _translated(outbound: OutboundChannel, sample: Report | bytes, session: str) -> list[tuple[str, bytes]]:
    """Return suffix and payload of each message for a sample; raises WireError."""
    if outbound.document and isinstance(sample, bytes) and not is_fleet_event(sample, outbound.channel):
        suffix, source_type = outbound.suffix, outbound.info.source_type
        return [(suffix, document_out(suffix, sample, source_type=source_type, session=session))]
    report = unproven(decode_report(outbound.channel, sample)) if isinstance(sample, bytes) else sample
    return to_mqtt(report, outbound.by, outbound.off)
