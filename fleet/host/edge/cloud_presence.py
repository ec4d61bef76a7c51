"""How the cloud sees that this edge is there: its heartbeats, and what is told there when it dies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import msgspec

from fleet.bridge.bridge import Bridge
from fleet.health.load import read_load
from fleet.model.state import EdgeState, RobotState
from fleet.supervisor.client import SupervisorClient


class CloudPresence:
    """That of one edge; its last words are left with its supervisor."""

    def __init__(self, bridge: Bridge, supervised: SupervisorClient) -> None:
        self._bridge = bridge
        self._supervised = supervised

    def leave_words(self) -> None:
        """Leave with the supervisor what the cloud is to be told when this process dies."""
        self._supervised.leave_notice(msgspec.json.encode(self._bridge.disconnect_plan()))

    def hold(self, twin: str, holder: str) -> None:
        """Leave a twin to another edge, which speaks for it, or take it back."""
        if self._bridge.hold(twin, holder):
            self.leave_words()

    def beat(self, edge: EdgeState, robots: Iterable[RobotState]) -> None:
        """Publish every twin's heartbeat, and the edge's own."""
        load = read_load()
        figures: Mapping[str, float | None] = {
            "host_memory_percent": load.memory_percent,
            "host_memory_available_mb": load.memory_available_mb,
            "cpu_temp_c": load.cpu_temperature,
        }
        known = {name: value for name, value in figures.items() if value is not None}
        self._bridge.beat(known, edge, robots)
