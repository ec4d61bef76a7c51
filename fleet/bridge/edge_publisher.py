"""Messages of the edge itself to the cloud: heartbeats, pings, connections, lost messages, replies."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from fleet.bridge.command_replies import RobotPort
from fleet.bridge.counters import ClassCounts
from fleet.clock import Clock
from fleet.model.command import Reply
from fleet.model.report import TelemetryReport
from fleet.model.state import EdgeState, RobotState
from fleet.spool.losses import Gap
from fleet.wire.health import edge_health, edge_state
from fleet.wire.ping import ping, pong
from fleet.wire.replies import legacy_status
from fleet.wire.reports import sender, to_mqtt
from fleet.wire.rules import TrafficClass, rule_of
from fleet.wire.topics import Topics


class EdgePublisher:
    """Publishes the edge's own messages on the topics of its twins.

    ``publish`` belongs to the client; ``session`` is in every message; ``published`` counts the messages.
    Queued messages are sent when the client is flushed.
    """

    def __init__(
        self, topics: Topics, *, edge: str, session: str, publish: Callable[..., bool], clock: Clock
    ) -> None:
        self.published = ClassCounts()
        self._topics = topics
        self._edge = edge
        self._session = session
        self._publish = publish
        self._clock = clock
        self._began = clock.monotonic()

    def telemetry(self, port: RobotPort, kind: str, fields: dict[str, object]) -> tuple[str, bytes]:
        """Return topic and payload of a telemetry message."""
        report = TelemetryReport(self._clock.time(), kind, fields)
        ((suffix, payload),) = to_mqtt(report, sender(source_type=port.source_type, session=self._session))
        return self._topics.twin(port.twin, suffix), payload

    def queue_telemetry(self, port: RobotPort, kind: str, fields: dict[str, object]) -> None:
        """Queue a telemetry message."""
        self.published.add(TrafficClass.EVENT)
        self._publish(*self.telemetry(port, kind, fields), qos=1, later=True)

    def queue_gap(self, port: RobotPort, suffix: str, gap: Gap) -> None:
        """Queue a report that messages of a twin's topic were lost."""
        fields = {
            "leaf": suffix,
            "reason": gap.reason,
            "lost": gap.lost,
            "since": gap.since,
            "until": gap.until,
        }
        self.queue_telemetry(port, "gap", fields)

    def queue_edge_state(self, edge: EdgeState, robots: Iterable[RobotState]) -> None:
        """Queue the state of the edge with all its robots."""
        self.published.add(TrafficClass.LATEST)
        payload = edge_state(edge, robots, session=self._session)
        self._publish(self._topics.edge(self._edge), payload, later=True)

    def queue_heartbeat(
        self, port: RobotPort, extra: Mapping[str, object], streams: Mapping[str, Mapping[str, object]]
    ) -> None:
        """Queue the heartbeat of a twin.

        ``extra`` holds figures of the host and the health of the robot; ``streams`` are those of programs on
        the bus.
        """
        payload = edge_health(
            twin=port.twin,
            edge_id=self._edge,
            uptime=self._clock.monotonic() - self._began,
            stamp=self._clock.time(),
            source_type=port.source_type,
            session=self._session,
            extra=extra,
            streams=streams,
        )
        self.published.add(TrafficClass.LATEST)
        self._publish(self._topics.twin(port.twin, "edge_health"), payload, later=True)

    def ping(self, twin: str) -> None:
        """Ping the cloud; sent immediately, because the round trip is measured."""
        payload = ping(stamp=self._clock.time(), session=self._session)
        self.published.add(TrafficClass.LATEST)
        self._publish(self._topics.twin(twin, "ping:request"), payload)

    def pong(self, port: RobotPort) -> None:
        """Answer a ping on a twin; sent immediately, because the round trip is measured."""
        payload = pong(
            stamp=self._clock.time(),
            edge_id=self._edge,
            source_type=port.source_type,
            session=self._session,
        )
        self.published.add(TrafficClass.LATEST)
        self._publish(self._topics.twin(port.twin, "pong:response"), payload)

    def status(self, uuid: str, suffix: str, payload: bytes) -> None:
        """Publish a status immediately on the topic of a suffix; it is kept until acknowledged."""
        rule = rule_of(suffix)
        self.published.add(TrafficClass.STATUS)
        topic = self._topics.twin(uuid, suffix)
        self._publish(
            topic, payload, qos=1, expiry=(rule and rule.max_age) or None, traffic=TrafficClass.STATUS
        )

    def publish_end(self, port: RobotPort, reply: Reply) -> None:
        """Publish the final status of a command whose process is gone."""
        if port.legacy_status:
            payload = legacy_status(reply, stamp=self._clock.time(), source_type=port.source_type)
            self.answer(self._topics.twin(port.twin, "command"), payload)

    def answer(self, topic: str, payload: bytes, *, correlation: bytes | None = None) -> None:
        """Publish a reply immediately; it expires as the rule of its topic says."""
        parsed = self._topics.parse(topic)
        rule = rule_of(parsed.suffix) if parsed else None
        self.published.add(TrafficClass.REPLY)
        self._publish(
            topic,
            payload,
            qos=1,
            expiry=(rule and rule.max_age) or None,
            correlation=correlation,
            content_type="application/json",
            traffic=TrafficClass.REPLY,
        )
