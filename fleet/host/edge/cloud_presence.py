"""Presence of this edge in the cloud: its heartbeats, and the messages for its death."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import msgspec

from fleet.bridge.bridge import Bridge
from fleet.health.load import read_load
from fleet.model.state import EdgeState, RobotState
from fleet.supervisor.client import SupervisorClient


class CloudPresence:
    """Presence of one edge; its last messages are stored with its supervisor."""

    def __init__(self, bridge: Bridge, supervised: SupervisorClient) -> None:
        self._bridge = bridge
        self._supervised = supervised

    def register_disconnect_messages(self) -> None:
        """Give the supervisor the messages that it publishes in the cloud when this process dies."""
        self._supervised.leave_notice(msgspec.json.encode(self._bridge.disconnect_plan()))

    def set_holder(self, twin: str, holder: str) -> None:
        """Leave a twin to another edge, which then speaks for it, or take it back."""
        if self._bridge.set_holder(twin, holder):
            self.register_disconnect_messages()

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
