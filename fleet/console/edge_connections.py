"""Connections of the console to the edges: receives their publications, and tracks which are joined."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from pathlib import Path

import msgspec

from fleet.bus import keys
from fleet.bus.bus import Bus
from fleet.bus.edge_buses import EdgeBuses
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.console.edge_queries import EdgeQueries
from fleet.console.fleet_view import FleetView, Goals
from fleet.console.task import ConsoleTask
from fleet.console.watched_reports import WatchedReports
from fleet.errors import WireError
from fleet.missions.report import MissionState, RunState
from fleet.model.description import RobotDescription
from fleet.model.report import PoseReport
from fleet.model.schedule import ScheduleAnswer
from fleet.model.state import EdgeState, RobotState
from fleet.runtime.decoding import decode_json
from fleet.wire.databus import decode_report

log = logging.getLogger(__name__)

POSITIONS = f"cw/*/data/{PoseReport.channel}"


class EdgeConnections:
    """The buses of the edges, and the newest sample of each key since the last ``apply_received``.

    ``joined`` are the joined buses, by edge.
    """

    def __init__(self, task: ConsoleTask, directory: Path, view: FleetView, clock: Clock) -> None:
        self._view = view
        self._clock = clock
        self._edges = EdgeBuses(
            task.edges,
            directory,
            clock,
            only=task.only,
            opened=self._opened,
            changed=self._connection_changed,
        )
        self.joined: Mapping[str, Bus] = self._edges.joined
        self.watched = WatchedReports(view, self.joined)
        self.queries = EdgeQueries(view, self.session_to, self.bus_sessions, self._arrived)
        self._lock = threading.Lock()
        self._pending: dict[str, bytes] = {}
        self._takers: Mapping[str, Callable[[list[str], bytes], None]] = {
            "robots/state": self._update_state,
            "robots/description": self._update_description,
            "health": self._update_health,
            "places": self._update_places,
            "missions": self._update_missions,
            "runs": self._update_run,
            "schedules": self._update_schedules,
            "data": self._update_pose,
        }

    def bus_sessions(self) -> dict[str, ZenohSession]:
        """Return the joined control sessions, by edge."""
        return {edge: bus.control for edge, bus in self._edges.joined.items()}

    def session_to(self, edge: str) -> ZenohSession | None:
        """Return the session for requests to an edge; another edge's if it is not joined itself."""
        bus_sessions = self.bus_sessions()
        return bus_sessions.get(edge) or next(iter(bus_sessions.values()), None)

    async def run(self) -> None:
        """Join edges that appear and leave those that are gone, until cancelled."""
        await self._edges.run()

    def _connection_changed(self, edge: str, problem: str | None) -> None:
        """Show whether an edge is joined, else why not."""
        self._view.set_edge_state(
            edge, alive=problem is None, problem=problem or "", now=self._clock.monotonic()
        )

    def _opened(self, _edge: str, bus: Bus) -> None:
        """Subscribe on an edge's bus, and query earlier publications; blocks."""
        for key in (keys.state("*", "*"), keys.health("*"), keys.positions("*", "*"), keys.run("*", "*")):
            bus.control.subscribe(key, self._arrived)
        bus.reports.subscribe_batches(POSITIONS, self._gathered)
        self.queries.request_states(bus.control)

    def _arrived(self, key: str, payload: bytes) -> None:
        """Keep the newest sample of a key; on the bus's threads."""
        with self._lock:
            self._pending[key] = payload

    def _gathered(self, samples: list[tuple[str, bytes]]) -> None:
        """Keep the newest sample of each key; on the bus's thread."""
        with self._lock:
            self._pending.update(samples)

    def apply_received(self) -> None:
        """Apply the received samples to the view; unreadable ones are logged and skipped."""
        self.watched.apply_received()
        with self._lock:
            pending, self._pending = self._pending, {}
        # States first: a pose is shown in the frame given by its robot's state.
        for key in sorted(pending, key=lambda key: key.startswith("cw/")):
            parts = key.split("/")
            kind = f"robots/{parts[-1]}" if parts[2] == "robots" else parts[2]
            taker = self._takers.get(kind)
            try:
                if taker is not None:
                    taker(parts, pending[key])
            except (msgspec.DecodeError, WireError, ValueError) as error:
                log.warning("the message on %s cannot be read: %s", key, error)

    def _update_state(self, _parts: list[str], payload: bytes) -> None:
        """Update a robot's state."""
        self._view.update_state(decode_json(payload, RobotState), self._clock.monotonic())

    def _update_health(self, _parts: list[str], payload: bytes) -> None:
        """Update an edge's state."""
        self._view.update_edge(decode_json(payload, EdgeState), self._clock.monotonic())

    def _update_places(self, parts: list[str], payload: bytes) -> None:
        """Update the goals of robots."""
        self._view.update_goals(parts[1], decode_json(payload, Goals))

    def _update_description(self, parts: list[str], payload: bytes) -> None:
        """Update a robot's vocabulary."""
        self._view.update_description(parts[1], decode_json(payload, RobotDescription))

    def _update_schedules(self, parts: list[str], payload: bytes) -> None:
        """Update the schedules of an edge."""
        self._view.update_schedules(parts[1], decode_json(payload, ScheduleAnswer).schedules)

    def _update_missions(self, _parts: list[str], payload: bytes) -> None:
        """Update the missions that can be started."""
        self._view.update_missions(decode_json(payload, list[MissionState]))

    def _update_run(self, _parts: list[str], payload: bytes) -> None:
        """Update a run of a mission."""
        self._view.update_run(decode_json(payload, RunState))

    def _update_pose(self, parts: list[str], payload: bytes) -> None:
        """Update the pose of a robot."""
        report = decode_report(PoseReport.channel, payload)
        if isinstance(report, PoseReport):
            self._view.update_pose(parts[1], report)
