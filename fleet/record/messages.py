"""Conversion of samples on the bus to recorded messages; pure.

Reports for which Foxglove has a schema are converted to it: positions in metres, world ENU to body FLU.
Foxglove's messages may have members beyond the schemas, which keep the rest of a report.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import msgspec
from msgspec.structs import asdict

from fleet.errors import WireError
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import GpsReport, JointReport, LogReport, PoseReport, Report
from fleet.model.site import Placement
from fleet.record.schemas import DOCUMENT, UNREAD
from fleet.wire.databus import decode_report
from fleet.wire.published import object_in, stamp_in

SITE = "site"
"""The common frame of the robots of an edge."""

_LEVELS = MappingProxyType(
    {"DEBUG": 1, "INFO": 2, "WARNING": 3, "ERROR": 4, "CRITICAL": 5}
)  # foxglove.LogLevel
_APPROXIMATED, _UNKNOWN = 1, 0  # foxglove.PositionCovarianceType
LATEST = 1.8e10
"""Unix s that fit MCAP's nanoseconds; a later stamp is invalid."""
_encode = msgspec.json.Encoder().encode


class Message(msgspec.Struct, frozen=True):
    """One message to record: topic, name of its schema, JSON, and its stamp (Unix s) if it has one."""

    topic: str
    schema: str
    payload: bytes
    stamp: float | None = None


def report_messages(robot: str, channel: str, sample: bytes, *, sensor: str | None = None) -> list[Message]:
    """Return the messages to record for a sample on a channel; ``robot`` is the prefix of its topics.

    A sample that is no report is kept as its JSON object, or as bytes.
    """
    topic = f"{robot}/{channel}" + (f"/{sensor}" if sensor else "")
    try:
        report = decode_report(channel, sample)
    except WireError:
        return [_other(topic, channel, sample)]
    made = _FOXGLOVE.get(channel)
    if isinstance(report, GpsReport) and report.point is None:
        return [_own(f"{topic}/no_fix", report)]
    if made is not None:
        return [
            Message(each, f"foxglove.{schema}", _encode(body), report.stamp)
            for each, schema, body in made(robot, topic, report)
        ]
    return [_own(topic, report)]


def placement_message(robot: str, placement: Placement, stamp: float) -> Message:
    """Return the transform from the site's frame to a robot's world frame."""
    half = placement.yaw / 2
    turned = Quaternion(math.cos(half), 0.0, 0.0, math.sin(half))
    body = _transform(stamp, SITE, _world(robot), placement.origin, turned)
    return Message(f"{robot}/world_transform", "foxglove.FrameTransform", _encode(body), stamp)


def unread(topic: str, sample: bytes) -> Message:
    """Return a sample as bytes, on a topic of its own."""
    return Message(f"{topic}/unread", UNREAD, _encode({"data": base64.b64encode(sample).decode()}))


def _other(topic: str, channel: str, sample: bytes) -> Message:
    """Return the message for a sample that is no report."""
    try:
        document = object_in(sample, channel)
    except WireError:
        return unread(topic, sample)
    try:
        stamp: float | None = stamp_in(document, sample)
    except WireError:
        stamp = None
    return Message(f"{topic}/document", DOCUMENT, _encode(document), stamp)


def _own(topic: str, report: Report) -> Message:
    """Return a report in the project's own format; values that are None are left out."""
    payload = _encode({name: value for name, value in asdict(report).items() if value is not None})
    if b"null" in payload:  # in a nested object, or only as a word in a text
        payload = _encode(_without_none(msgspec.to_builtins(report)))
    return Message(topic, f"fleet.{type(report).__name__}", payload, report.stamp)


def _without_none(value: Any) -> Any:
    """Return JSON values without members that are null."""
    if isinstance(value, dict):
        return {name: _without_none(each) for name, each in value.items() if each is not None}
    return [_without_none(each) for each in value] if isinstance(value, (list, tuple)) else value


def _time(stamp: float) -> dict[str, int]:
    """Return Unix seconds in Foxglove's format; 0 for an invalid stamp."""
    nanoseconds = round(stamp * 1e9) if 0 <= stamp < LATEST else 0
    return {"sec": nanoseconds // 1_000_000_000, "nsec": nanoseconds % 1_000_000_000}


def _world(robot: str) -> str:
    """Return the name of the frame in which a robot reports its pose."""
    return f"{robot.strip('/')}/world"


def _transform(stamp: float, parent: str, child: str, at: Vector3, turned: Quaternion) -> dict[str, object]:
    """Return a foxglove.FrameTransform."""
    return {
        "timestamp": _time(stamp),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": at,
        "rotation": turned,
    }


def _pose(robot: str, topic: str, report: PoseReport) -> list[tuple[str, str, object]]:
    """Return a pose, also as a transform."""
    pose: dict[str, object] = {
        "timestamp": _time(report.stamp),
        "frame_id": _world(robot),
        "pose": {"position": report.position, "orientation": report.rotation},
    }
    if report.frame_id:
        pose["cloud_frame_id"] = report.frame_id
    moved = _transform(report.stamp, _world(robot), robot.strip("/"), report.position, report.rotation)
    return [(topic, "PoseInFrame", pose), (f"{robot}/transform", "FrameTransform", moved)]


def _fix(robot: str, topic: str, report: GpsReport) -> list[tuple[str, str, object]]:
    """Return a satellite fix with a position."""
    point = report.point
    assert point is not None
    known = report.horizontal_accuracy is not None
    level, up = (report.horizontal_accuracy or 0.0) ** 2, (report.vertical_accuracy or 0.0) ** 2
    more = {"fix_type": report.fix_type, "satellites": report.satellites}
    fix: dict[str, object] = {
        "timestamp": _time(report.stamp),
        "frame_id": robot.strip("/"),
        "latitude": point.latitude,
        "longitude": point.longitude,
        "altitude": point.altitude,
        "position_covariance": [level, 0.0, 0.0, 0.0, level, 0.0, 0.0, 0.0, up],
        "position_covariance_type": _APPROXIMATED if known else _UNKNOWN,
        "metadata": [{"key": name, "value": str(value)} for name, value in more.items() if value is not None],
    }
    if report.heading is not None:
        fix["heading"] = math.radians(report.heading)
    return [(topic, "LocationFix", fix)]


def _joints(_robot: str, topic: str, report: JointReport) -> list[tuple[str, str, object]]:
    """Return joints; values that are not measured are left out."""
    sets = {"position": report.positions, "velocity": report.velocities, "effort": report.efforts}
    joints = [
        {"name": name} | {what: values[name] for what, values in sets.items() if name in values}
        for name in report.positions
    ]
    body: dict[str, object] = {"timestamp": _time(report.stamp), "joints": joints}
    if report.tags is not None:
        body["tags"] = report.tags
    return [(topic, "JointStates", body)]


def _log(robot: str, topic: str, report: LogReport) -> list[tuple[str, str, object]]:
    """Return a line of a log."""
    body: dict[str, object] = {
        "timestamp": _time(report.stamp),
        "level": _LEVELS.get(report.level, 0),
        "message": report.message,
        "name": robot.strip("/"),
        "file": "",
        "line": 0,
    }
    if report.about:
        body["about"] = report.about
    return [(topic, "Log", body)]


_FOXGLOVE: Mapping[str, Callable[[str, str, Any], list[tuple[str, str, object]]]] = MappingProxyType(
    {
        PoseReport.channel: _pose,
        GpsReport.channel: _fix,
        JointReport.channel: _joints,
        LogReport.channel: _log,
    }
)
"""Converters to Foxglove's formats by channel: topic, schema and body of each message."""
