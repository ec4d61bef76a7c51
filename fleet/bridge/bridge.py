"""The bridge of one edge: both directions of its twins, their heartbeats, and conflicts with other edges."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any

import msgspec

from fleet.bridge.command_replies import RobotPort
from fleet.bridge.disconnect_program import DisconnectPlan
from fleet.bridge.downlink import Downlink, MessageHandler
from fleet.bridge.edge_publisher import EdgePublisher
from fleet.bridge.outbound_channel import TwinInfo
from fleet.bridge.owned_streams import OwnedStreams
from fleet.bridge.relay import Put
from fleet.bridge.round_trip import RoundTrip
from fleet.bridge.twin_conflicts import TwinConflictMonitor
from fleet.bridge.uplink import Uplink
from fleet.clock import Clock
from fleet.cloud.client import CloudClient, PublishRoute
from fleet.cloud.credentials import client_id
from fleet.cloud.values import CloudMessage, CloudSettings, CloudState, Will
from fleet.model.health import Health, Level, degraded
from fleet.model.state import EdgeState, RobotState
from fleet.runtime.rate_limited_counter import RateLimitedCounter
from fleet.spool.losses import Gap
from fleet.spool.spool import Spool
from fleet.wire.edge_heartbeat import read_heartbeat
from fleet.wire.ping import check_ping
from fleet.wire.rulebook import Rulebook
from fleet.wire.rules import TopicRule
from fleet.wire.sub_states import TELEMETRY_END
from fleet.wire.topics import Topic, Topics

log = logging.getLogger(__name__)

HEARTBEAT = 5.0  # s between edge_health messages of a twin (contract 9.2)


class BridgeRules(msgspec.Struct, frozen=True):
    """Forwarding rules: by UUID for each twin, environment and workflow; one rulebook for all workflow runs.

    Heartbeats of ``ignored_edges`` claim no twin.
    """

    twins: dict[str, Rulebook]
    environments: Mapping[str, Rulebook] = {}
    any_run: Rulebook | None = None
    ignored_edges: frozenset[str] = frozenset()
    workflows: Mapping[str, Rulebook] = {}


class Bridge:
    """The connection between the bus and one broker.

    ``alive`` returns whether a robot answers. ``put`` publishes on the bus. ``claimed`` is called with twin
    and edge when heartbeats in the cloud show that another edge serves the twin, and with an empty edge name
    when that edge is gone. ``spool`` stores durable messages; it is closed with the bridge. ``handlers``
    handle, by topic suffix, requests to the edge itself. ``publisher`` publishes the edge's own messages;
    ``streams`` are the video streams of programs on the bus.
    """

    def __init__(
        self,
        settings: CloudSettings,
        topics: Topics,
        ports: dict[str, RobotPort],
        *,
        edge: str,
        rules: BridgeRules,
        put: Put,
        alive: Callable[[str], bool],
        claimed: Callable[[str, str], None],
        clock: Clock,
        spool: Spool | None = None,
        handlers: Mapping[str, MessageHandler] = MappingProxyType({}),
    ) -> None:
        self._topics = topics
        self._ports = ports
        self._rules = rules
        self._alive = alive
        self._clock = clock
        self._settings = settings
        self.session = session = settings.client_id or client_id("fleet", simulated=False)
        self.refusals = RateLimitedCounter(log, clock)

        def publish(topic: str, payload: bytes, **how: Any) -> bool:
            return self.client.publish(topic, payload, **how)  # the client is built after its publishers

        self.publisher = EdgePublisher(topics, edge=edge, session=session, publish=publish, clock=clock)
        self._held: dict[str, str] = {}
        self.streams = OwnedStreams(ports, self.refusals, clock)
        self._conflicts = TwinConflictMonitor(
            edge=edge, session=session, ignored=rules.ignored_edges, changed=claimed, clock=clock
        )
        self.round_trip = RoundTrip(self._ping, clock)
        self.downlink = Downlink(
            topics,
            ports,
            books={**rules.twins, **rules.environments, **rules.workflows},
            any_run=rules.any_run,
            session=session,
            send=self.publisher.answer,
            put=put,
            own={
                "edge_health": lambda topic, message: self._conflicts.handle_heartbeat(
                    topic.twin, read_heartbeat(message.payload)
                ),
                "ping:request": self._handle_ping,
                "pong:response": self._handle_pong,
                **handlers,
            },
            refusals=self.refusals,
            clock=clock,
        )
        self.client = CloudClient(
            msgspec.structs.replace(settings, client_id=session, will=self._will()),
            subscriptions(topics, rules),
            on_message=self.downlink.arrived,
            on_read=self.downlink.dispatch,
            on_state=self._state_changed,
            clock=clock,
            spool=spool,
        )
        self._infos = _infos(ports, rules)

        def open_route(topic: str, rule: TopicRule) -> PublishRoute:
            return self.client.route(topic, qos=rule.qos, traffic=rule.traffic, expiry=rule.max_age or None)

        self.uplink = Uplink(
            topics,
            self._infos,
            session=session,
            open_route=open_route,
            client=self.client,
            alive=alive,
            waiting=lambda: self.client.stats.queued_bytes,
            full=lambda: self.client.full,
            refusals=self.refusals,
            clock=clock,
        )
        self._pings = any("pong:response" in book.inward for book in rules.twins.values())

    @property
    def health(self) -> Health:
        """Health of the cloud connection."""
        client = self.client
        if client.state is CloudState.CONNECTED:  # the cause: subscriptions that the broker refuses
            return degraded(client.cause or client.spool.problem)
        level = Level.FAULT if client.state is CloudState.REFUSED else Level.DEGRADED
        return Health(level, f"cloud {client.state.value}: {client.cause}")

    def start(self) -> None:
        """Start to connect."""
        self.client.start()

    def close(self) -> None:
        """Report every twin as disconnected, then close the connection."""
        for port in self._served():
            self.publisher.queue_telemetry(port, "disconnected", {"reason": "the edge ends"})
            if self._alive(port.name) and port.twin not in self.uplink.streaming:
                self.publisher.queue_telemetry(port, TELEMETRY_END, {})
        self.client.close()

    def join(self, port: RobotPort, rules: Rulebook) -> None:
        """Start to serve a twin, or replace the robot of a twin that is served; on the loop."""
        before = self._ports.get(port.twin)
        if before is None:
            self.streams.join(port.twin)
        elif before.name != port.name:
            self.downlink.leave(port.twin, before.name)
        self._rules.twins[port.twin] = rules
        self._infos[port.twin] = TwinInfo(port.name, port.source_type, rules)
        self._ports[port.twin] = port
        self.downlink.join(port, rules)
        self.uplink.drop(port.twin)
        self._resubscribe()

    def leave(self, twin: str) -> None:
        """Stop serving a twin and report it as disconnected; on the loop."""
        port = self._ports.get(twin)
        if port is None:
            return
        if twin not in self._held:
            self.publisher.queue_telemetry(port, "disconnected", {"reason": "the edge no longer serves it"})
        for table in (self._ports, self._rules.twins, self._infos):
            table.pop(twin)
        self._held.pop(twin, None)
        self.uplink.held, self.downlink.held = frozenset(self._held), dict(self._held)
        self.downlink.leave(twin, port.name)
        self.uplink.drop(twin)
        self.streams.leave(twin)
        self._resubscribe()

    def _resubscribe(self) -> None:
        """Subscribe to the topics of the twins that are served now."""
        self._pings = any("pong:response" in book.inward for book in self._rules.twins.values())
        self.client.resubscribe(subscriptions(self._topics, self._rules))
        self.client.flush_queued()

    def handle_samples(self, samples: Iterable[tuple[str, bytes]]) -> None:
        """Handle samples of other programs on the bus, by key; on the bus thread. Events are sent at once."""
        for key, sample in samples:
            self.uplink.arrived(key, sample)
        self.client.flush_queued()

    def tick(self) -> Iterator[None]:
        """Publish the due messages step by step; at the end of each tick of the scheduler."""
        self.downlink.send_refusals()
        yield from self.uplink.tick()
        self.client.flush_queued()

    def disconnect_plan(self) -> DisconnectPlan:
        """Return the plan that reports the twins as disconnected if this process dies."""
        topics = tuple(self._topics.twin(port.twin, "telemetry") for port in self._served())
        return DisconnectPlan(self._settings, self.session, topics)

    def set_holder(self, twin: str, holder: str) -> bool:
        """Leave a twin to another edge, or take it back if ``holder`` is empty; False if nothing changes."""
        if twin not in self._ports or holder == self._held.get(twin, ""):
            return False
        if holder:
            self._held[twin] = holder
            line = "%s: edge %s holds its twin: this edge forwards nothing for it"
            log.warning(line, self._ports[twin].name, holder)
        else:
            del self._held[twin]
            log.info("%s: its twin is ours again", self._ports[twin].name)
        self.uplink.held, self.downlink.held = frozenset(self._held), dict(self._held)
        return True

    def beat(
        self, extra: Mapping[str, object], edge: EdgeState | None = None, robots: Iterable[RobotState] = ()
    ) -> None:
        """Publish the heartbeat of every twin, with the health of its robot, and the state of the edge.

        ``extra`` holds figures of the host.
        """
        states = {state.twin: state for state in robots}
        self._conflicts.check()
        if self._pings and self.client.state is CloudState.CONNECTED:
            self.round_trip.request()
        for port in self._served():
            state = states.get(port.twin)
            how = {"health": state.health, "cause": state.cause} if state else {}
            self.publisher.queue_heartbeat(port, {**extra, **how}, self.streams.of(port.twin))
        if edge is not None:
            self.publisher.queue_edge_state(edge, states.values())
        if self.client.state is CloudState.CONNECTED:
            for gap in (
                *self.client.spool.take_gaps(),
                *self.uplink.events.take_suppressed(self._clock.monotonic()),
            ):
                self._report_gap(gap)
        self.client.flush_queued()

    def _will(self) -> Will | None:
        """Return the will. A connection has only one, so it covers the first twin only."""
        for port in list(self._ports.values()):
            topic, payload = self.publisher.telemetry(port, "disconnected", {"reason": "the edge vanished"})
            return Will(topic, payload, qos=1)
        return None

    def _served(self) -> list[RobotPort]:
        """Return the robots whose twins no other edge holds."""
        return [port for twin, port in list(self._ports.items()) if twin not in self._held]

    def _ping(self) -> None:
        """Ping the cloud on the first twin, to measure the round trip."""
        for twin in self._ports:
            self.publisher.ping(twin)
            return

    def _handle_ping(self, topic: Topic, message: CloudMessage) -> None:
        """Answer a ping on one of our twins."""
        check_ping(message.payload)
        if topic.twin in self._ports and topic.twin not in self._held:
            self.publisher.pong(self._ports[topic.twin])

    def _handle_pong(self, _topic: Topic, message: CloudMessage) -> None:
        """Handle the pong of the cloud."""
        self.round_trip.handle_pong(message.payload)

    def _report_gap(self, gap: Gap) -> None:
        """Report on the telemetry of a twin that messages of a topic were lost."""
        parsed = self._topics.parse(gap.topic)
        port = self._ports.get(parsed.twin) if parsed else None
        if parsed is None or port is None:
            return
        log.warning("%s: %d messages on %s were lost (%s)", port.name, gap.lost, parsed.suffix, gap.reason)
        self.publisher.queue_gap(port, parsed.suffix, gap)

    def _state_changed(self, state: CloudState, cause: str) -> None:
        """Log the new connection state; after a reconnect, publish the current state of everything."""
        fallen = state in (CloudState.DISCONNECTED, CloudState.REFUSED)
        unsubscribed = state is CloudState.CONNECTED and cause
        level = logging.WARNING if fallen or unsubscribed else logging.INFO
        log.log(level, "cloud %s%s", state.value, f": {cause}" if cause else "")
        if state is CloudState.CONNECTED:
            self.uplink.publish_newest()
            self.client.flush_queued()  # the current state first, then the queue
            self._publish_connections()

    def _publish_connections(self) -> None:
        """Correct the connection states in the cloud.

        The broker may have published our will, and a previous run of the edge may have left robots as
        connected that do not answer now.
        """
        first = self.client.stats.connects == 1
        for port in self._served():
            alive = self._alive(port.name)
            if alive and not first:
                self.publisher.queue_telemetry(port, "connected", {})
            elif first and not alive:
                self.publisher.queue_telemetry(
                    port, "disconnected", {"reason": "no answer yet: the edge has just started"}
                )
        self.client.flush_queued()


def subscriptions(topics: Topics, rules: BridgeRules) -> dict[str, int]:
    """Return the subscriptions: filter to QoS. No two filters overlap."""
    filters = {
        topics.filter(rule.suffix, uuid): rule.qos
        for books in (rules.twins, rules.environments, rules.workflows)
        for uuid, book in books.items()
        for rule in book.inward.values()
    }
    runs = rules.any_run.inward if rules.any_run else {}
    return filters | {topics.filter(rule.suffix): rule.qos for rule in runs.values()}


def _infos(ports: Mapping[str, RobotPort], rules: BridgeRules) -> dict[str, TwinInfo]:
    """Return the outbound settings of each twin, and of each environment, which has no robot."""
    twins = {twin: TwinInfo(port.name, port.source_type, rules.twins[twin]) for twin, port in ports.items()}
    return twins | {uuid: TwinInfo("", "edge", book) for uuid, book in rules.environments.items()}
