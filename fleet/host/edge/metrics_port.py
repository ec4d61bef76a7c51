"""Serves an edge's metrics where fleet.yaml asks for it, and retries while the port is taken."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from fleet.config.schema import MetricsConfig
from fleet.errors import MetricsError

if TYPE_CHECKING:
    from fleet.host.edge.metrics import Metrics

log = logging.getLogger(__name__)


class MetricsPort:
    """Port of the ``metrics``; ``problem`` is why it is not open, empty while it is."""

    def __init__(self, metrics: Metrics, config: MetricsConfig) -> None:
        self.problem = ""
        self._metrics = metrics
        self._config = config

    def serve(self) -> None:
        """Open the port, unless it is open; a port that is taken is logged once."""
        if self._metrics.port:
            return
        try:
            self._metrics.serve(self._config.host, self._config.port)
        except MetricsError as error:
            if str(error) != self.problem:
                log.error("%s; it is tried again", error)  # noqa: TRY400 - one line for a person
            self.problem = str(error)
        else:
            self.problem = ""
