"""Conversion of samples on the buses of edges to messages, with names of edges and robots.

The key of a report has only the uuid of its twin; the state of a robot gives the robot's name.
"""

from __future__ import annotations

import functools
from typing import Any

import msgspec

from fleet.history.record import Record
from fleet.link.tap import LinkFrames
from fleet.missions.report import RunState
from fleet.model.description import RobotDescription
from fleet.model.schedule import ScheduleAnswer
from fleet.model.state import EdgeState, RobotState
from fleet.record.messages import Message, placement_message, report_messages, unread
from fleet.record.schemas import DOCUMENT
from fleet.runtime.decoding import decode_json
from fleet.wire.topics import parse_data_key

MOST_RUNS = 100  # runs stored until they end; a run of a dead edge never ends
_encode = msgspec.json.Encoder().encode
_parsed = functools.lru_cache(maxsize=4096)(parse_data_key)  # 200 robots have half as many


class SampleReader:
    """Converts samples to messages; stores the robot of each twin."""

    def __init__(self) -> None:
        self._robots: dict[str, tuple[str, str]] = {}
        self._last_frames: dict[str, tuple[int, int]] = {}  # last number and dropped of each process
        self._lost = 0
        self._runs: dict[tuple[str, str], Message] = {}
        self._persistent: dict[str, Message] = {}  # by topic

    def read(self, edge: str, key: str, payload: bytes) -> list[Message]:
        """Return the messages to record for a sample from the bus of an edge.

        An unreadable one is kept as bytes. A sample of another edge's robot is skipped: connected edges
        receive each other's reports, and it also comes from its own edge's bus.
        """
        data = _parsed(key)
        if data is not None:
            known = self._robots.get(data.twin)
            if known is not None and known[0] != edge:
                return []
            robot = known[1] if known is not None else f"/twins/{data.twin}"
            return report_messages(robot, data.channel, payload, sensor=data.sensor)
        inner = key.split("/")[2:]
        topic = "/".join(["", edge, *inner])
        try:
            return self._of_edge(topic, inner, payload)
        except (msgspec.DecodeError, ValueError, RecursionError):
            return [unread(topic, payload)]

    @property
    def persistent_values(self) -> list[Message]:
        """The persistent values: runs in progress, fences and bodies of robots, schedules."""
        return [*self._persistent.values(), *self._runs.values()]

    def take_lost(self) -> int:
        """Return the number of lost frames, or messages with frames, since the last call."""
        lost, self._lost = self._lost, 0
        return lost

    def _of_edge(self, topic: str, inner: list[str], payload: bytes) -> list[Message]:
        """Return the messages for an edge's own publications; raises for unreadable ones."""
        kind = inner[0] if inner else ""
        if kind == "schedules" or (kind == "robots" and inner[-1] == "description"):
            return self._changed(_persistent_message(topic, kind, payload))
        if kind == "robots" and inner[-1] == "state":
            return self._state(decode_json(payload, RobotState))
        if kind == "health":
            health = decode_json(payload, EdgeState)
            return [Message(topic, "fleet.EdgeState", payload, health.stamp)]
        if kind == "runs":
            return [self._run(topic.rpartition("/")[0], decode_json(payload, RunState), payload)]
        if kind == "frames":
            return self._of_links(topic, decode_json(payload, LinkFrames), payload)
        document: object = decode_json(payload, Any)
        is_object = isinstance(document, dict)
        return [Message(topic, DOCUMENT, payload if is_object else _encode({"value": document}))]

    def _run(self, topic: str, run: RunState, payload: bytes) -> Message:
        """Return a run of a mission, and store it until it ends."""
        message = Message(topic, "fleet.RunState", payload)
        self._runs.pop((topic, run.run), None)
        if not run.outcome:
            self._runs[topic, run.run] = message
            while len(self._runs) > MOST_RUNS:
                self._runs.pop(next(iter(self._runs)))
        return message

    def _changed(self, message: Message) -> list[Message]:
        """Return and store a message that differs from its topic's last one; else nothing."""
        if self._persistent.get(message.topic) == message:
            return []
        self._persistent[message.topic] = message
        return [message]

    def _of_links(self, topic: str, frames: LinkFrames, payload: bytes) -> list[Message]:
        """Return the frames of a link, and count the missing ones."""
        number, dropped = self._last_frames.get(topic, (frames.number - 1, 0))
        if frames.number > number:  # else its process has restarted
            self._lost += frames.number - number - 1 + max(0, frames.dropped - dropped)
        self._last_frames[topic] = frames.number, frames.dropped
        edge = topic.split("/")[1]
        return [Message(f"/{edge}/{frames.robot}/frames", "fleet.LinkFrames", payload, frames.stamp)]

    def _state(self, state: RobotState) -> list[Message]:
        """Return a robot's state, and the transform of its world frame in the site."""
        robot = f"/{state.edge}/{state.name}"
        if state.twin:
            self._robots[state.twin] = (state.edge, robot)
        messages = [Message(f"{robot}/state", "fleet.RobotState", _encode(state), state.stamp)]
        if state.placement is not None:
            messages.append(placement_message(robot, state.placement, state.stamp))
        return messages


def _persistent_message(topic: str, kind: str, payload: bytes) -> Message:
    """Return the schedules of an edge, or the parts of a description for drawings; raises DecodeError.

    The present refusals of commands are not recorded.
    """
    if kind == "schedules":
        decode_json(payload, ScheduleAnswer)
        return Message(topic, "fleet.ScheduleAnswer", payload)
    description = decode_json(payload, RobotDescription)
    kept = RobotDescription(
        description.robot, description.adapter, (), fence=description.fence, body=description.body
    )
    edge = topic.split("/")[1]
    return Message(f"/{edge}/{description.robot}/description", "fleet.RobotDescription", _encode(kept))


def event_message(edge: str, event: Record) -> Message:
    """Return an event of an edge's history: a command, its outcome, a stop, a change of health, a mission."""
    topic = f"/{edge}/{event.robot}/history" if event.robot else f"/{edge}/history"
    return Message(topic, "fleet.Record", _encode(msgspec.structs.replace(event, edge=edge)), event.stamp)
