"""The fleet at a moment of a recording, in the form of the live view of a page; pure."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import msgspec

from fleet.console.commands import shown_event
from fleet.console.fleet_view import FleetView, Goals, id_of
from fleet.console.recorded_numbers import recorded_numbers
from fleet.history.record import Record
from fleet.missions.report import RunState
from fleet.model.description import RobotDescription
from fleet.model.report import PoseReport
from fleet.model.schedule import ScheduleAnswer
from fleet.model.state import EdgeState, RobotState
from fleet.replay.reports import report_in
from fleet.runtime.decoding import decode_json

if TYPE_CHECKING:
    from fleet.record.reading import ReadMessage  # its packages are an extra

log = logging.getLogger(__name__)

SILENT = 3.0  # s without a message after which an edge counts as away
_STATE = "fleet.RobotState"
_BROKEN = (msgspec.DecodeError, ValueError, KeyError, TypeError)


def moment(at: float, found: Iterable[ReadMessage], track: Iterable[ReadMessage]) -> dict[str, Any]:
    """Return the fleet at a moment (Unix s) from the newest messages before it, with tracks.

    ``recorded`` is the time of the last message; if it is much older than the moment, nothing was recorded
    then.
    """
    shown = _Shown(at)
    # States first: a pose is shown in the frame given by its robot's state.
    ordered = sorted(found, key=lambda each: (each.schema != _STATE, each.received))
    for message in ordered:
        shown.apply(message)
    recorded = max((each.received for each in ordered), default=0.0)
    return {"at": at, "recorded": recorded, **shown.entries(), "tracks": shown.tracks(track)}


class _Shown:
    """The entries of a moment, collected from messages."""

    def __init__(self, at: float) -> None:
        self._at = at
        self._view = FleetView()
        self._heard: dict[str, float] = {}
        self._events: list[Record] = []
        self._takers = {
            _STATE: self._state,
            "fleet.EdgeState": self._edge,
            "fleet.RunState": self._run,
            "fleet.Record": self._event,
            "fleet.Document": self._places,
            "fleet.RobotDescription": self._description,
            "fleet.ScheduleAnswer": self._schedules,
            "foxglove.PoseInFrame": self._pose,
            "foxglove.JointStates": self._joints,
        }

    def apply(self, message: ReadMessage) -> None:
        """Apply a message; an unreadable one is logged and skipped."""
        try:
            self._takers[message.schema](message)
        except _BROKEN as error:
            log.warning("the message recorded on %s cannot be read: %s", message.topic, error)

    def entries(self) -> dict[str, Any]:
        """Return the entries by kind and identity, and the events, newest first."""
        for edge, heard in self._heard.items():
            if self._at - heard > SILENT:
                why = f"nothing of it was recorded for {self._at - heard:.0f} s"
                self._view.set_edge_state(edge, alive=False, problem=why, now=heard)
        events = sorted(self._events, key=lambda event: -event.stamp)
        return {"entries": self._view.since(0), "events": [_shown_event(event) for event in events]}

    def tracks(self, found: Iterable[ReadMessage]) -> dict[str, list[list[float]]]:
        """Return the tracks of robots, each in the frame in which its robot is shown."""
        tracks: dict[str, list[list[float]]] = {}
        for message in found:
            name = id_of(message.edge, message.robot)
            report = _pose_in(message)
            if report is not None and name in self._view.states:
                tracks.setdefault(name, []).append(self._view.shown_pose(name, report)[:2])
        return tracks

    def _state(self, message: ReadMessage) -> None:
        """Apply the state of a robot."""
        self._view.update_state(decode_json(message.data, RobotState), message.received)
        self._hear(message)

    def _edge(self, message: ReadMessage) -> None:
        """Apply the state of an edge."""
        self._view.update_edge(decode_json(message.data, EdgeState), message.received)
        self._hear(message)

    def _hear(self, message: ReadMessage) -> None:
        """Update the time of an edge's last message."""
        self._heard[message.edge] = max(message.received, self._heard.get(message.edge, 0.0))

    def _run(self, message: ReadMessage) -> None:
        """Apply a run of a mission; the newest comes last."""
        self._view.update_run(decode_json(message.data, RunState))

    def _event(self, message: ReadMessage) -> None:
        """Apply an event."""
        self._events.append(decode_json(message.data, Record))

    def _places(self, message: ReadMessage) -> None:
        """Apply the goals of an edge's robots, unless they are outdated."""
        if self._at - message.received <= SILENT:
            self._view.update_goals(message.edge, decode_json(message.data, Goals))

    def _description(self, message: ReadMessage) -> None:
        """Apply the fence and the body of a robot."""
        self._view.update_description(message.edge, decode_json(message.data, RobotDescription))

    def _schedules(self, message: ReadMessage) -> None:
        """Apply the schedules of an edge."""
        self._view.update_schedules(message.edge, decode_json(message.data, ScheduleAnswer).schedules)

    def _pose(self, message: ReadMessage) -> None:
        """Apply the position and attitude of a robot."""
        name = id_of(message.edge, message.robot)
        report = _pose_in(message)
        if report is not None and name in self._view.states:
            self._view.put("poses", name, self._view.shown_pose(name, report))
            self._add_numbers(message)

    def _joints(self, message: ReadMessage) -> None:
        """Apply the joint positions of a robot, unless they are outdated."""
        if self._at - message.received <= SILENT:
            self._add_numbers(message)

    def _add_numbers(self, message: ReadMessage) -> None:
        """Add the numbers of a report."""
        name = id_of(message.edge, message.robot)
        known = self._view.get("numbers", name) or {}
        self._view.put("numbers", name, {**known, **recorded_numbers(message)})


def _pose_in(message: ReadMessage) -> PoseReport | None:
    """Return the pose of a recorded position; None for other messages."""
    try:
        report = report_in(message.schema, message.data)
    except ValueError:
        return None
    return report if isinstance(report, PoseReport) else None


def _shown_event(event: Record) -> Mapping[str, object]:
    """Return an event with its robot, for a page."""
    return {
        "edge": event.edge,
        "robot": id_of(event.edge, event.robot) if event.robot else "",
        **shown_event(event),
    }
