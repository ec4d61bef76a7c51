"""The bridge of one edge: its own twins, both ways, and their heartbeat."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import msgspec

from fleet.bridge.downlink import Downlink, Port
from fleet.bridge.uplink import TwinInfo, Uplink
from fleet.clock import Clock
from fleet.cloud.client import CloudClient
from fleet.cloud.credentials import client_id
from fleet.cloud.values import CloudSettings, CloudState, Message, Will
from fleet.model.report import TelemetryReport
from fleet.spool.losses import Gap
from fleet.spool.spool import Spool
from fleet.wire.health import edge_health
from fleet.wire.reports import to_mqtt
from fleet.wire.rules import Traffic, rule_of
from fleet.wire.topics import Topics

log = logging.getLogger(__name__)

HEARTBEAT = 5.0  # s between edge_health messages of a twin (contract 9.2)


class Bridge:
    """Everything between the bus and one broker.

    ``soon`` runs a call on the event loop, from any thread. ``alive`` tells whether a robot answers.
    ``spool`` keeps what is durable; it is closed with the bridge.
    """

    def __init__(
        self,
        settings: CloudSettings,
        topics: Topics,
        ports: Mapping[str, Port],
        *,
        edge: str,
        soon: Callable[[Callable[[], None]], None],
        alive: Callable[[str], bool],
        clock: Clock,
        spool: Spool | None = None,
    ) -> None:
        self._edge = edge
        self._topics = topics
        self._ports = ports
        self._clock = clock
        self._alive = alive
        self._queued = False
        self._soon = soon
        self._kinds: dict[str, Traffic] = {}
        self._began = clock.monotonic()
        session = settings.client_id or client_id("fleet", simulated=False)
        subscriptions: dict[str, int] = {}
        for twin in ports:
            subscriptions |= topics.inbound(twin)
        self._session = session
        self.client = CloudClient(
            msgspec.structs.replace(settings, client_id=session, will=self._will()),
            subscriptions,
            on_message=self._arrived,
            on_state=self._state_changed,
            clock=clock,
            spool=spool,
        )
        twins = {twin: TwinInfo(port.name, port.source_type) for twin, port in ports.items()}
        self.uplink = Uplink(topics, twins, session=session, publish=self._publish, alive=alive)
        self.downlink = Downlink(topics, ports, session=session, send=self._answer, soon=soon, clock=clock)

    def start(self) -> None:
        """Begin to connect."""
        self.client.start()

    def close(self) -> None:
        """Say that every twin is disconnected, and leave."""
        for port in self._ports.values():
            self._say(port, "disconnected", {"reason": "the edge ends"})
        self.client.close()

    def turn(self) -> Iterator[None]:
        """Publish what is due, step by step; at the end of each turn of the wheel."""
        yield from self.uplink.turn(self._clock.monotonic())
        if self._queued:  # a wake-up of the cloud's thread costs more than a message
            self._queued = False
            self.client.flush()

    def beat(self, extra: Mapping[str, Any]) -> None:
        """Publish the heartbeat of every twin; ``extra``: host figures."""
        for twin, port in self._ports.items():
            payload = edge_health(
                twin=twin,
                edge_id=self._edge,
                uptime=self._clock.monotonic() - self._began,
                stamp=self._clock.time(),
                source_type=port.source_type,
                session=self._session,
                extra=extra,
            )
            self.client.publish(self._topics.twin(twin, "edge_health"), payload)
        if self.client.state is CloudState.CONNECTED:
            for gap in self.client.spool.take_gaps():
                self._tell_gap(gap)

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
        topic, payload = self._telemetry(port, kind, fields)
        self.client.publish(topic, payload, qos=1)

    def _publish(self, topic: str, payload: bytes, qos: int) -> bool:
        """Queue for the next flush."""
        self._queued = True
        if not qos:
            return self.client.publish(topic, payload)
        kind = self._kinds.get(topic)
        if kind is None:
            kind = self._kinds[topic] = self._kind(topic)
        return self.client.publish(topic, payload, qos=qos, traffic=kind)

    def _kind(self, topic: str) -> Traffic:
        """Return how much what is durable on a topic matters."""
        parsed = self._topics.parse(topic)
        rule = rule_of(parsed.leaf) if parsed else None
        return rule.traffic if rule and rule.traffic.durable else Traffic.EVENT

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
        """Publish an answer at once."""
        self.client.publish(
            topic,
            payload,
            qos=1,
            correlation=correlation,
            content_type="application/json",
            traffic=Traffic.REPLY,
        )

    def _arrived(self, messages: list[Message]) -> None:
        """Take messages; on the cloud's thread."""
        self.downlink.arrived(messages)

    def _state_changed(self, state: CloudState, cause: str) -> None:
        """Tell how the connection stands; on the cloud's thread."""
        fallen = state in (CloudState.DISCONNECTED, CloudState.REFUSED)
        level = logging.WARNING if fallen else logging.INFO
        log.log(level, "cloud %s%s", state.value, f": {cause}" if cause else "")
        if state is CloudState.CONNECTED:
            self._soon(self._say_newest)
            if self.client.stats.connects > 1:
                self._say_connected()

    def _say_newest(self) -> None:
        """Say how everything is now, before what waited meanwhile."""
        self.uplink.say_newest(self._clock.monotonic())
        self.client.flush()

    def _say_connected(self) -> None:
        """Take back the will: the broker may have told everybody that we vanished."""
        for port in self._ports.values():
            if self._alive(port.name):
                self._say(port, "connected", {})
