"""Conversion of recorded messages to reports, the inverse of ``fleet.record.messages``; pure.

Source of the foxglove.* formats: https://docs.foxglove.dev/docs/sdk/schemas.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, get_args

import msgspec

from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import GpsReport, JointReport, JointTags, LogReport, PoseReport, Report
from fleet.runtime.decoding import decode_json

_LEVELS = MappingProxyType({1: "DEBUG", 2: "INFO", 3: "WARNING", 4: "ERROR", 5: "CRITICAL"})
_KINDS: Mapping[str, type[Any]] = MappingProxyType(
    {f"fleet.{kind.__name__}": kind for kind in get_args(Report)}
)


def report_in(schema: str, data: bytes) -> Report | None:
    """Return the report of a recorded message; None if it is no report.

    Raises ValueError for a damaged one.
    """
    made = _FOXGLOVE.get(schema)
    kind = _KINDS.get(schema)
    if made is None and kind is None:
        return None
    try:
        document: Any = decode_json(data, Any)
        if made is not None:
            return made(document)
        assert kind is not None
        if kind is GpsReport:
            document.setdefault("point", None)  # null members are not recorded
        report: Report = decode_json(msgspec.json.encode(document), kind)
    except (msgspec.DecodeError, msgspec.ValidationError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"a recorded {schema} cannot be read: {error}") from None
    return report


def _stamp(document: Mapping[str, Any]) -> float:
    """Return Unix seconds."""
    time = document["timestamp"]
    return float(time["sec"] + time["nsec"] / 1e9)


def _pose(document: Mapping[str, Any]) -> PoseReport:
    """Return a pose from foxglove.PoseInFrame."""
    pose = document["pose"]
    return PoseReport(
        _stamp(document),
        Vector3(**pose["position"]),
        Quaternion(**pose["orientation"]),
        document.get("cloud_frame_id", ""),
    )


def _fix(document: Mapping[str, Any]) -> GpsReport:
    """Return a satellite fix from foxglove.LocationFix."""
    more = {each["key"]: each["value"] for each in document.get("metadata", ())}
    spread = document["position_covariance"] if document.get("position_covariance_type") else None
    heading = document.get("heading")
    return GpsReport(
        _stamp(document),
        GeoPoint(document["latitude"], document["longitude"], document["altitude"]),
        more.get("fix_type", ""),
        int(more["satellites"]) if "satellites" in more else None,
        math.degrees(heading) if heading is not None else None,
        math.sqrt(spread[0]) if spread else None,
        (math.sqrt(spread[8]) or None) if spread else None,
    )


def _joints(document: Mapping[str, Any]) -> JointReport:
    """Return joints from foxglove.JointStates."""
    joints = document["joints"]
    tags = decode_json(msgspec.json.encode(document["tags"]), JointTags) if "tags" in document else None
    positions, velocities, efforts = (
        {each["name"]: each[what] for each in joints if what in each}
        for what in ("position", "velocity", "effort")
    )
    return JointReport(_stamp(document), positions, velocities, efforts, tags)


def _log(document: Mapping[str, Any]) -> LogReport:
    """Return a line of a log from foxglove.Log."""
    level = _LEVELS.get(document["level"], "INFO")
    return LogReport(_stamp(document), level, document["message"], document.get("about", {}))


_FOXGLOVE: Mapping[str, Callable[[Mapping[str, Any]], Report]] = MappingProxyType(
    {
        "foxglove.PoseInFrame": _pose,
        "foxglove.LocationFix": _fix,
        "foxglove.JointStates": _joints,
        "foxglove.Log": _log,
    }
)
