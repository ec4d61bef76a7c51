"""The part of a recording about one robot: the frames of its links, and its recorded reports; pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import msgspec

from fleet.link.tap import LinkFrame, LinkFrames
from fleet.record.reading import ReadMessage
from fleet.runtime.decoding import decode_json

FRAMES = "fleet.LinkFrames"
_NO_REPORTS = frozenset(
    {
        "foxglove.FrameTransform",
        "fleet.RobotState",
        "fleet.RobotDescription",
        "fleet.Record",
        "fleet.Document",
        "fleet.Unread",
        FRAMES,
    }
)
"""Schemas below the topics of a robot that are no reports; a transform repeats the pose."""
_STAMPS = ("timestamp", "stamp")


class RecordedReport(msgspec.Struct, frozen=True):
    """One report: its stamp (Unix s), and its other members."""

    stamp: float
    content: Mapping[str, Any]


class RecordedRobot(msgspec.Struct, frozen=True):
    """One robot: frames with their link in the order of time, and reports by channel.

    A channel is the topic without the robot's name; a channel with several kinds of messages is split by
    kind, as in ``telemetry:vehicle_state``.
    """

    edge: str
    name: str
    frames: tuple[tuple[str, LinkFrame], ...]
    reports: Mapping[str, list[RecordedReport]]

    @property
    def links(self) -> tuple[str, ...]:
        """The links of its frames, in the order of first use."""
        return tuple(dict.fromkeys(link for link, _ in self.frames))

    @property
    def is_whole(self) -> bool:
        """True if it has the robot's links from their opening, so nothing was learned before."""
        opened: dict[str, str] = {}
        for link, frame in self.frames:
            opened.setdefault(link, frame.direction)
        return bool(opened) and all(direction == "open" for direction in opened.values())


class Recording(msgspec.Struct, frozen=True):
    """The content of a file: reports by robot (edge and name), and frames by link."""

    reports: dict[tuple[str, str], dict[str, list[RecordedReport]]]
    frames: dict[tuple[str, str], list[LinkFrame]]
    openers: dict[tuple[str, str], set[str]]

    @property
    def robots(self) -> list[tuple[str, str]]:
        """Edge and name of the robots with frames, in order."""
        return sorted({(edge, robot) for edge, robot in self.openers if robot})

    def robot(self, edge: str, name: str, links: Iterable[str] = ()) -> RecordedRobot:
        """Return a robot with the frames of the links that it opened, and of ``links`` opened by others."""
        wanted = self.openers.get((edge, name), set()) | set(links)
        found = [
            (link, frame)
            for (of_edge, link), frames in self.frames.items()
            if of_edge == edge and link in wanted
            for frame in frames
        ]
        ordered = tuple(sorted(found, key=lambda pair: pair[1].at))
        return RecordedRobot(edge, name, ordered, self.reports.get((edge, name), {}))


def recording_of(messages: Iterable[ReadMessage]) -> Recording:
    """Return the robots and links in messages; raises ValueError for a damaged one."""
    recording = Recording({}, {}, {})
    for message in messages:
        robot = message.edge, message.robot
        if message.schema == FRAMES:
            link_frames = decode_json(message.data, LinkFrames)
            recording.frames.setdefault((message.edge, link_frames.link), []).extend(link_frames.frames)
            recording.openers.setdefault((message.edge, link_frames.robot), set()).add(link_frames.link)
        elif message.robot and message.schema not in _NO_REPORTS:
            topic = message.topic.split("/", 3)[3]
            channel, said = said_in(topic, message.data, message.stamp)
            recording.reports.setdefault(robot, {}).setdefault(channel, []).append(said)
    return recording


def said_in(topic: str, data: bytes, stamp: float) -> tuple[str, RecordedReport]:
    """Return the channel and content of a recorded report; ``topic`` is without the robot."""
    document: dict[str, Any] = decode_json(data, dict[str, Any])
    content = {name: value for name, value in document.items() if name not in _STAMPS}
    kind = content.get("type")
    return f"{topic}:{kind}" if isinstance(kind, str) else topic, RecordedReport(stamp, content)
