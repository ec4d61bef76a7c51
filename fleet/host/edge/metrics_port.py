"""Serves an edge's figures where fleet.yaml asks for it, and tries again where the port is taken."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from fleet.config.schema import MetricsConfig
from fleet.errors import MetricsError

if TYPE_CHECKING:
    from fleet.host.edge.metrics import Metrics

log = logging.getLogger(__name__)


class MetricsPort:
    """The port of some ``metrics``; ``problem`` says why it is not open, empty while it is."""

    def __init__(self, metrics: Metrics, config: MetricsConfig) -> None:
        self.problem = ""
        self._metrics = metrics
        self._config = config

    def serve(self) -> None:
        """Open it, unless that is done; a port that is taken is told once."""
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
