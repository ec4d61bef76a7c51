"""Serves what a fleet view shows as metrics of Prometheus, on this computer's loopback."""

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
    """The figures of the edges that were taken last; ``port`` is where they are served."""

    def __init__(self, clock: Clock) -> None:
        self.port = 0
        self._clock = clock
        self._edges: Sequence[SeenEdge] = ()

    def serve(self, port: int) -> None:
        """Serve from now on, on a thread of its own; raises MetricsError when the port cannot be had."""
        registry = CollectorRegistry()
        registry.register(self)
        try:
            server, _ = start_http_server(port, HOST, registry)
        except OSError as error:
            raise MetricsError(f"--metrics: {HOST}:{port} cannot be opened: {error.strerror}") from None
        self.port = int(server.server_port)

    def take(self, edges: Sequence[SeenEdge]) -> None:
        """Take how the edges are now."""
        self._edges = edges

    def describe(self) -> Iterable[Metric]:
        """Return nothing: what there is is known once it is collected."""
        return ()

    def collect(self) -> Iterator[Metric]:
        """Yield every figure, now."""
        yield from fleet_metrics(self._edges, self._clock.time())
