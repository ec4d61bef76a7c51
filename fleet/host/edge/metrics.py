"""Metrics of the edge for Prometheus, at ``/metrics``.

Off unless fleet.yaml has ``metrics:``: an edge opens no unwanted port, and two edges on one computer would
compete for it. The server's own thread reads counters that other threads write.
"""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from threading import Thread
from typing import Any, Protocol

from prometheus_client import CollectorRegistry, start_http_server
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector

from fleet.bridge.bridge import Bridge
from fleet.errors import MetricsError
from fleet.health.metrics import summary_metrics
from fleet.host.edge.summaries import Summaries
from fleet.model.state import EdgeState, RobotState
from fleet.spool.statistics import SpoolStatistics
from fleet.wire.rules import TrafficClass

log = logging.getLogger(__name__)


class MetricsSource(Protocol):
    """The edge, as the source of the metrics."""

    bridge: Bridge | None
    summaries: Summaries

    def state(self) -> EdgeState:
        """Return the edge's own state."""

    def states(self) -> list[RobotState]:
        """Return the robots' states."""


class Metrics(Collector):
    """Collects the metrics on request."""

    def __init__(self, edge: MetricsSource) -> None:
        self._edge = edge
        self._server: Any = None
        self._thread: Thread | None = None

    @property
    def port(self) -> int:
        """The port being served, 0 for none."""
        return int(self._server.server_port) if self._server is not None else 0

    def serve(self, host: str, port: int) -> None:
        """Start serving, on a separate thread; raises MetricsError when the port is not available."""
        registry = CollectorRegistry()
        registry.register(self)
        try:
            self._server, self._thread = start_http_server(port, host, registry)
        except OSError as error:
            raise MetricsError(f"metrics: {host}:{port} cannot be opened: {error.strerror}") from None
        log.info("metrics at http://%s:%d/metrics", host, self.port)

    def close(self) -> None:
        """Stop serving."""
        if self._server is not None and self._thread is not None:
            self._server.shutdown()
            self._server.server_close()
            self._thread.join()

    def describe(self) -> Iterable[Metric]:
        """Return nothing: the metrics are known only once collected."""
        return ()

    def collect(self) -> Iterator[Metric]:
        """Yield all metrics, as of now."""
        yield from _robots(self._edge.states())
        yield from _edge(self._edge.state())
        newest = self._edge.summaries.newest
        yield from summary_metrics([newest] if newest is not None else [])
        bridge = self._edge.bridge
        if bridge is not None:
            yield from _outward(bridge)
            yield from _inward(bridge)
            yield from _cloud(bridge)
            yield from _spool(bridge.client.spool.figures(), time.time())


def _robots(states: Iterable[RobotState]) -> Iterator[Metric]:
    """Yield whether each robot is reachable, and its battery."""
    up = GaugeMetricFamily("fleet_robot_up", "1 while the robot answers.", labels=["robot", "health"])
    battery = GaugeMetricFamily("fleet_robot_battery_percent", "Charge of the battery.", labels=["robot"])
    for state in states:
        up.add_metric([state.name, state.health], float(state.health in ("ok", "degraded")))
        if state.battery is not None:
            battery.add_metric([state.name], state.battery)
    yield up
    yield battery


def _edge(state: EdgeState) -> Iterator[Metric]:
    """Yield metrics of the process."""
    yield GaugeMetricFamily("fleet_uptime_seconds", "Since the edge began.", state.uptime)
    yield GaugeMetricFamily("fleet_threads", "Threads of the edge.", float(state.threads or 0))
    yield CounterMetricFamily("fleet_lost", "Reports and messages lost on the way out.", float(state.dropped))


def _outward(bridge: Bridge) -> Iterator[Metric]:
    """Yield the traffic from the bus to the cloud, by class."""
    uplink = bridge.uplink
    sent = Counter(uplink.sent.by_class()) + Counter(bridge.publisher.published.by_class())
    counters: tuple[tuple[str, str, Mapping[str, int]], ...] = (
        ("received", "Samples of our twins that came from the bus.", uplink.received.by_class()),
        ("sent", "Messages handed to the cloud's connection.", sent),
        ("conflated", "Samples that a newer one replaced before its turn.", uplink.conflated.by_class()),
        (
            "dropped",
            "Samples above their rate; samples of streams while the connection was full.",
            uplink.dropped.by_class(),
        ),
    )
    for name, about, counts in counters:
        family = CounterMetricFamily(f"fleet_outward_{name}", about, labels=["traffic"])
        for traffic in TrafficClass:
            family.add_metric([traffic.word], float(counts[traffic.word]))
        yield family
    yield GaugeMetricFamily("fleet_outward_waiting", "Samples waiting for their turn.", float(uplink.waiting))


def _inward(bridge: Bridge) -> Iterator[Metric]:
    """Yield the traffic from the cloud, the refusals in both directions, and the latency of commands."""
    downlink = bridge.downlink
    received = CounterMetricFamily("fleet_inward_received", "Messages from the cloud.", labels=["taker"])
    for taker, count in dict(downlink.received).items():
        received.add_metric([taker], float(count))
    answered = CounterMetricFamily(
        "fleet_commands_answered", "Requests answered, by status.", labels=["status"]
    )
    for status, count in dict(downlink.answered).items():
        answered.add_metric([status], float(count))
    refused = CounterMetricFamily("fleet_refused", "Refused at the bridge, by reason.", labels=["reason"])
    for reason, count in bridge.refusals.counts().items():
        refused.add_metric([reason], float(count))
    latency = HistogramMetricFamily(
        "fleet_command_latency_seconds", "From a message's arrival to its receipt.", labels=["robot"]
    )
    for robot, latencies in list(downlink.latencies.items()):
        latency.add_metric([robot], latencies.buckets(), latencies.total)
    yield from (received, answered, refused, latency)


def _cloud(bridge: Bridge) -> Iterator[Metric]:
    """Yield metrics of the connection to the cloud."""
    stats = bridge.client.stats
    gauges = (
        ("queued_messages", "Messages waiting to be sent.", stats.queued),
        ("queued_bytes", "Bytes waiting to be sent.", stats.queued_bytes),
        ("window_messages", "QoS 1 messages that the broker has not acknowledged yet.", stats.inflight),
        ("broker_round_trip_seconds", "From a message to its acknowledgement.", stats.rtt),
        ("round_trip_seconds", "From a ping to the cloud's pong.", bridge.round_trip.seconds),
    )
    for name, about, value in gauges:
        if value is not None:
            yield GaugeMetricFamily(f"fleet_cloud_{name}", about, float(value))
    counters = (
        ("connects", "Times that the connection was made.", stats.connects),
        ("sent", "Messages written.", stats.sent),
        ("acknowledged", "QoS 1 messages that the broker acknowledged.", stats.acked),
        ("dropped", "Messages that ran out of time or room.", stats.dropped),
        ("refused", "Messages that the broker refused.", stats.refused),
    )
    for name, about, count in counters:
        yield CounterMetricFamily(f"fleet_cloud_{name}", about, float(count))


def _spool(figures: SpoolStatistics, now: float) -> Iterator[Metric]:
    """Yield the messages in the spool, by class, and its losses; ``now`` is Unix time."""
    gauges = {
        name: GaugeMetricFamily(f"fleet_spool_{name}", about, labels=["traffic"])
        for name, about in (
            ("messages", "Messages that wait for the cloud."),
            ("on_disk_messages", "Waiting messages that are on disk only."),
            ("memory_bytes", "Payload bytes of those in memory."),
            ("oldest_age_seconds", "Age of the oldest waiting message; 0 without any."),
        )
    }
    for traffic, class_ in figures.classes.items():
        age = 0.0 if class_.oldest is None else max(0.0, now - class_.oldest)
        values = (class_.messages, class_.on_disk, class_.memory, age)
        for family, value in zip(gauges.values(), values, strict=True):
            family.add_metric([traffic.word], float(value))
    yield from gauges.values()
    lost = CounterMetricFamily(
        "fleet_spool_lost", "Messages that will never arrive.", labels=["traffic", "reason"]
    )
    for (traffic, reason), count in figures.lost.items():
        lost.add_metric([traffic.word, reason.value], float(count))
    yield lost
    yield GaugeMetricFamily("fleet_spool_disk_bytes", "Bytes of the spool's file in use.", figures.disk)
    held = "Topics that wait for a subscriber."
    yield GaugeMetricFamily("fleet_spool_held_topics", held, figures.held_topics)
    fine = float(not figures.problem)
    yield GaugeMetricFamily("fleet_spool_disk_works", "1 while messages can be written to disk.", fine)
