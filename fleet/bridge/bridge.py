"""The bridge of one edge: its own twins, both ways, their heartbeat, and who else claims them."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import msgspec

from fleet.bridge.answers import Port
from fleet.bridge.counters import ClassCounts
from fleet.bridge.downlink import Downlink
from fleet.bridge.relay import Put
from fleet.bridge.rivals import Rivals
from fleet.bridge.roundtrip import PING_EVERY, RoundTrip
from fleet.bridge.uplink import TwinInfo, Uplink
from fleet.clock import Clock
from fleet.cloud.client import CloudClient
from fleet.cloud.credentials import client_id
from fleet.cloud.values import CloudSettings, CloudState, Message, Will
from fleet.model.report import TelemetryReport
from fleet.spool.losses import Gap
from fleet.spool.spool import Spool
from fleet.tally import Tally
from fleet.wire.claims import read_heartbeat
from fleet.wire.health import edge_health
from fleet.wire.ping import check_ping, ping, pong
from fleet.wire.reports import to_mqtt
from fleet.wire.rulebook import Rulebook
from fleet.wire.rules import Rule, Traffic, rule_of
from fleet.wire.topics import Topic, Topics

log = logging.getLogger(__name__)

HEARTBEAT = 5.0  # s between edge_health messages of a twin (contract 9.2)


class Rules(msgspec.Struct, frozen=True):
    """What crosses: of each twin, of each environment (by uuid), and of workflow runs, whatever their uuid.

    ``ignored_edges`` are edges whose heartbeat does not claim a twin.
    """

    twins: Mapping[str, Rulebook]
    environments: Mapping[str, Rulebook] = {}
    any_run: Rulebook | None = None
    ignored_edges: frozenset[str] = frozenset()


class Bridge:
    """Everything between the bus and one broker.

    ``alive`` tells whether a robot answers. ``put`` publishes on the bus. ``claimed`` hears twin and edge
    when the cloud shows another edge that has the twin, with an empty name when it has let go. ``spool``
    keeps what is durable; it is closed with the bridge.
    ``said`` counts what the edge says itself: answers, heartbeats, who came and went.
    """

    def __init__(
        self,
        settings: CloudSettings,
        topics: Topics,
        ports: Mapping[str, Port],
        *,
        edge: str,
        rules: Rules,
        put: Put,
        alive: Callable[[str], bool],
        claimed: Callable[[str, str], None],
        clock: Clock,
        spool: Spool | None = None,
    ) -> None:
        self._edge = edge
        self._topics = topics
        self._ports = ports
        self._clock = clock
        self._alive = alive
        self._began = clock.monotonic()
        self._next_ping = self._began
        session = settings.client_id or client_id("fleet", simulated=False)
        self._session = session
        self.refusals = Tally(log, clock)
        self.said = ClassCounts()
        self._held: dict[str, str] = {}
        self._rivals = Rivals(
            edge=edge, session=session, ignored=rules.ignored_edges, changed=claimed, clock=clock
        )
        self.round_trip = RoundTrip(self._ping, clock)
        self.uplink = Uplink(
            topics,
            _infos(ports, rules),
            session=session,
            open_way=self._open_way,
            alive=alive,
            waiting=lambda: self.client.stats.queued_bytes,
            refusals=self.refusals,
            clock=clock,
        )
        self.downlink = Downlink(
            topics,
            ports,
            books={**rules.twins, **rules.environments},
            any_run=rules.any_run,
            session=session,
            send=self._answer,
            put=put,
            own={
                "edge_health": self._heard_heartbeat,
                "ping:request": self._heard_ping,
                "pong:response": self._heard_pong,
            },
            refusals=self.refusals,
            clock=clock,
        )
        self.client = CloudClient(
            msgspec.structs.replace(settings, client_id=session, will=self._will()),
            subscriptions(topics, rules),
            on_message=self.downlink.arrived,
            on_read=self.downlink.take,
            on_state=self._state_changed,
            clock=clock,
            spool=spool,
        )
        self._pings = any("pong:response" in book.inward for book in rules.twins.values())

    def start(self) -> None:
        """Begin to connect."""
        self.client.start()

    def close(self) -> None:
        """Say that every twin is disconnected, and leave."""
        for port in self._served():
            self._say(port, "disconnected", {"reason": "the edge ends"})
        self.client.close()

    def heard(self, samples: Iterable[tuple[str, bytes]]) -> None:
        """Take what others said on the bus, by key; on the bus's thread. Events of it leave at once."""
        for key, sample in samples:
            self.uplink.arrived(key, sample)
        self.client.flush_queued()

    def turn(self) -> Iterator[None]:
        """Publish what is due, step by step; at the end of each turn of the wheel."""
        yield from self.uplink.turn()
        self.client.flush_queued()

    def hold(self, twin: str, holder: str) -> None:
        """Leave a twin to another edge, or take it back when ``holder`` is empty."""
        if holder == self._held.get(twin, ""):
            return
        if holder:
            self._held[twin] = holder
            line = "%s: edge %s has its twin: nothing crosses for it here"
            log.warning(line, self._ports[twin].name, holder)
        else:
            del self._held[twin]
            log.info("%s: its twin is ours again", self._ports[twin].name)
        self.uplink.held = self.downlink.held = frozenset(self._held)

    def beat(self, extra: Mapping[str, Any]) -> None:
        """Publish the heartbeat of every twin; ``extra``: host figures."""
        self._rivals.look()
        if self._pings and self._clock.monotonic() >= self._next_ping:
            self._next_ping = self._clock.monotonic() + PING_EVERY
            self.round_trip.ask()
        for port in self._served():
            payload = edge_health(
                twin=port.twin,
                edge_id=self._edge,
                uptime=self._clock.monotonic() - self._began,
                stamp=self._clock.time(),
                source_type=port.source_type,
                session=self._session,
                extra=extra,
            )
            self._say_now(self._topics.twin(port.twin, "edge_health"), payload)
        if self.client.state is CloudState.CONNECTED:
            for gap in self.client.spool.take_gaps():
                self._tell_gap(gap)
        self.client.flush_queued()

    def _will(self) -> Will | None:
        """Return what the broker says when we vanish; a connection has one will, so for one twin."""
        for port in self._ports.values():
            (topic, payload) = self._telemetry(port, "disconnected", {"reason": "the edge vanished"})
            return Will(topic, payload, qos=1)
        return None

    def _telemetry(self, port: Port, kind: str, fields: dict[str, Any]) -> tuple[str, bytes]:
        """Return topic and payload of a telemetry message."""
        report = TelemetryReport(self._clock.time(), kind, fields)
        ((leaf, payload),) = to_mqtt(report, source_type=port.source_type, session=self._session)
        return self._topics.twin(port.twin, leaf), payload

    def _say(self, port: Port, kind: str, fields: dict[str, Any]) -> None:
        """Publish a telemetry message."""
        self.said.add(Traffic.EVENT)
        self.client.publish(*self._telemetry(port, kind, fields), qos=1, later=True)

    def _say_now(self, topic: str, payload: bytes) -> None:
        """Publish what is of no use later."""
        self.said.add(Traffic.LATEST)
        self.client.publish(topic, payload, later=True)

    def _say_at_once(self, topic: str, payload: bytes) -> None:
        """Publish what is timed: it does not wait for the turn's end."""
        self.said.add(Traffic.LATEST)
        self.client.publish(topic, payload)

    def _served(self) -> list[Port]:
        """Return the robots whose twins no other edge has."""
        return [port for twin, port in self._ports.items() if twin not in self._held]

    def _open_way(self, topic: str, rule: Rule) -> Callable[[bytes], object]:
        """Return what queues messages to a topic by a rule, for the next flush; any thread."""
        return self.client.way(topic, qos=rule.qos, traffic=rule.traffic, expiry=rule.max_age or None)

    def _ping(self) -> None:
        """Ask how far the cloud is, by the first twin."""
        for twin in self._ports:
            payload = ping(stamp=self._clock.time(), session=self._session)
            self._say_at_once(self._topics.twin(twin, "ping:request"), payload)
            return

    def _heard_ping(self, topic: Topic, message: Message) -> None:
        """Answer a ping at one of our twins."""
        check_ping(message.payload)
        port = self._ports[topic.twin]
        if topic.twin in self._held:
            return
        payload = pong(
            stamp=self._clock.time(),
            edge_id=self._edge,
            source_type=port.source_type,
            session=self._session,
        )
        self._say_at_once(self._topics.twin(topic.twin, "pong:response"), payload)

    def _heard_pong(self, _topic: Topic, message: Message) -> None:
        """Take the cloud's answer to our ping."""
        self.round_trip.heard(message.payload)

    def _heard_heartbeat(self, topic: Topic, message: Message) -> None:
        """Take the heartbeat of another edge for one of our twins."""
        self._rivals.heard(topic.twin, read_heartbeat(message.payload))

    def _tell_gap(self, gap: Gap) -> None:
        """Say on the twin's telemetry that messages of a topic were lost."""
        parsed = self._topics.parse(gap.topic)
        port = self._ports.get(parsed.twin) if parsed else None
        if parsed is None or port is None:
            return
        fields = {"leaf": parsed.leaf, "reason": gap.reason, "lost": gap.lost, "since": gap.since}
        log.warning("%s: %d messages on %s were lost (%s)", port.name, gap.lost, parsed.leaf, gap.reason)
        self._say(port, "gap", {**fields, "until": gap.until})

    def _answer(self, topic: str, payload: bytes, *, correlation: bytes | None = None) -> None:
        """Publish an answer at once; nobody waits for it longer than its rule says."""
        parsed = self._topics.parse(topic)
        rule = rule_of(parsed.leaf) if parsed else None
        self.said.add(Traffic.REPLY)
        self.client.publish(
            topic,
            payload,
            qos=1,
            expiry=(rule and rule.max_age) or None,
            correlation=correlation,
            content_type="application/json",
            traffic=Traffic.REPLY,
        )

    def _state_changed(self, state: CloudState, cause: str) -> None:
        """Tell how the connection stands, and a broker that is back how everything is now."""
        fallen = state in (CloudState.DISCONNECTED, CloudState.REFUSED)
        level = logging.WARNING if fallen else logging.INFO
        log.log(level, "cloud %s%s", state.value, f": {cause}" if cause else "")
        if state is CloudState.CONNECTED:
            self._say_newest()
            if self.client.stats.connects > 1:
                self._say_connected()

    def _say_newest(self) -> None:
        """Say how everything is now, before what waited meanwhile."""
        self.uplink.say_newest()
        self.client.flush_queued()

    def _say_connected(self) -> None:
        """Take back the will: the broker may have told everybody that we vanished."""
        for port in self._served():
            if self._alive(port.name):
                self._say(port, "connected", {})
        self.client.flush_queued()


def subscriptions(topics: Topics, rules: Rules) -> dict[str, int]:
    """Return what to subscribe to: filter to QoS; no two of them overlap."""
    filters = {
        topics.filter(rule.leaf, uuid): rule.qos
        for books in (rules.twins, rules.environments)
        for uuid, book in books.items()
        for rule in book.inward.values()
    }
    runs = rules.any_run.inward if rules.any_run else {}
    return filters | {topics.filter(rule.leaf): rule.qos for rule in runs.values()}


def _infos(ports: Mapping[str, Port], rules: Rules) -> dict[str, TwinInfo]:
    """Return what the uplink knows of each twin, and of each environment, which has no robot."""
    twins = {twin: TwinInfo(port.name, port.source_type, rules.twins[twin]) for twin, port in ports.items()}
    return twins | {uuid: TwinInfo("", "edge", book) for uuid, book in rules.environments.items()}
