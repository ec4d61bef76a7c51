"""Serves a fleet view as Prometheus metrics on the loopback interface."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from prometheus_client import CollectorRegistry, start_http_server
from prometheus_client.core import Metric
from prometheus_client.registry import Collector

from fleet.clock import Clock
from fleet.errors import MetricsError
from fleet.health.metrics import fleet_metrics
from fleet.health.rollup import SeenEdge

HOST = "127.0.0.1"


class FleetMetrics(Collector):
    """Metrics of the last update of the edges; ``port`` is the port on which they are served."""

    def __init__(self, clock: Clock) -> None:
        self.port = 0
        self._clock = clock
        self._edges: Sequence[SeenEdge] = ()

    def serve(self, port: int) -> None:
        """Start serving on a thread of its own; raises MetricsError if the port cannot be opened."""
        registry = CollectorRegistry()
        registry.register(self)
        try:
            server, _ = start_http_server(port, HOST, registry)
        except OSError as error:
            raise MetricsError(f"--metrics: {HOST}:{port} cannot be opened: {error.strerror}") from None
        self.port = int(server.server_port)

    def update(self, edges: Sequence[SeenEdge]) -> None:
        """Store the present state of the edges."""
        self._edges = edges

    def describe(self) -> Iterable[Metric]:
        """Return nothing: the metrics are not known before they are collected."""
        return ()

    def collect(self) -> Iterator[Metric]:
        """Yield all metrics."""
        yield from fleet_metrics(self._edges, self._clock.time())
