"""Encoder of reports as MQTT messages, in the forms that Cyberwave's SDK and storage read.

These differ from the bus payloads of the same reports (``fleet.wire.databus``): the bridge translates, it
does not copy. Unknown values are not sent, nor is a number that is not finite.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from msgspec import UNSET

from fleet.errors import WireError
from fleet.model.event import EventReport
from fleet.model.geodesy import GeoPoint
from fleet.model.navigation import ActionState
from fleet.model.report import (
    BatteryReport,
    DepthReport,
    FlightControllerReport,
    FlightStateReport,
    GpsReport,
    LogReport,
    MetricsReport,
    MissionProgress,
    NavigationReport,
    PhotoReport,
    PointCloudReport,
    Report,
    ScaleReport,
    TelemetryReport,
)
from fleet.wire.arrays import check_depth, check_pointcloud
from fleet.wire.encoding import encode_finite
from fleet.wire.events import CLOUD_EVENTS, event_body
from fleet.wire.layouts import MessageSource, depth_data
from fleet.wire.missions import run_of
from fleet.wire.rules import Layout
from fleet.wire.states import STATES, StateMessage
from fleet.wire.strict_json import finite, without_nulls

UNTAGGED_TELEMETRY = frozenset({"connected", "disconnected"})  # the SDK sends these without source type
OF_A_STREAM = frozenset({"camera_sync_frame"})  # their ``session_id`` is that of a video stream

JsonObject = dict[str, Any]
Leaves = list[tuple[str, JsonObject]]
ReportMessage = JsonObject | StateMessage


@functools.lru_cache(maxsize=1024)  # the same for most reports
def sender(
    *, source_type: str, session: str = "", sensor: str | None = None, layout: Layout = ""
) -> MessageSource:
    """Return the message source for a twin.

    ``session`` is the edge's client id, omitted when empty; ``sensor`` the sensor that measured, where the
    bus key names one; ``layout`` that of the payload, for a topic with several.
    """
    fields = {"source_type": source_type}
    if session:
        fields["session_id"] = session
    if sensor:
        fields["sensor_id"] = sensor
    return MessageSource(source_type, session or UNSET, sensor or UNSET, fields, layout)


def to_mqtt(report: Report, by: MessageSource, off: frozenset[str] = frozenset()) -> list[tuple[str, bytes]]:
    """Return the messages of a report (see ``messages_of``) encoded as JSON.

    Raises WireError for a number that is not finite or out of its range.
    """
    return [(suffix, encode_finite(body)) for suffix, body in messages_of(report, by, off)]


def messages_of(
    report: Report, by: MessageSource, off: frozenset[str] = frozenset()
) -> Sequence[tuple[str, ReportMessage]]:
    """Return the messages of a report: (suffix of the twin's topic, message), usually one, possibly none.

    The suffix of joints is ``joint:update``, which ``Topics.twin`` resolves. No field of a report can
    replace those of ``by``; ``off`` holds the suffixes not to send. Raises WireError for a value out of its
    range.
    """
    make = STATES.get(type(report), _enveloped)
    made: Sequence[tuple[str, ReportMessage]] = make(report, by)
    return [each for each in made if each[0] not in off] if off else made


def _enveloped(report: Report, by: MessageSource) -> Leaves:
    """Return the bodies of a report with the fields that all messages carry, which nothing can replace."""
    suffixes = _depth(report, by) if isinstance(report, DepthReport) else _FORMS[type(report)](report)
    for suffix, body in suffixes:
        stream = body.get("session_id") if suffix == "telemetry" and body["type"] in OF_A_STREAM else None
        body.update(by.fields, timestamp=report.stamp)
        if stream is not None:
            body["session_id"] = stream
        if suffix == "telemetry" and body["type"] in UNTAGGED_TELEMETRY:
            del body["source_type"]
    return suffixes


def _scale(report: ScaleReport) -> Leaves:
    """Scale in object form."""
    if min(report.scale.x, report.scale.y, report.scale.z) <= 0:
        raise WireError("every axis needs more than 0", where="scale")
    return [("scale", {"type": "scale", "scale": report.scale})]


def _battery(report: BatteryReport) -> Leaves:
    """``twin.battery.v1``: nothing when the percentage is unknown."""
    if report.percent is None:
        return []
    if not 0 <= report.percent <= 100:
        raise WireError(f"0 to 100 percent is possible, not {report.percent}", where="percent")
    body = {"percentage": report.percent, "voltage": report.voltage, "current": report.current}
    return [("battery/status", without_nulls(body))]


def _gps(report: GpsReport) -> Leaves:
    """Nothing without a fix."""
    if report.fix_type == "none" or report.point is None:
        return []
    body = {
        **_place(report.point),
        "satellite_count": report.satellites,
        "compass_heading": None if report.heading is None else report.heading % 360.0,
        "horizontal_accuracy": report.horizontal_accuracy,
        "vertical_accuracy": report.vertical_accuracy,
        "fix_type": report.fix_type,
    }
    return [("gps", without_nulls(body))]


def _place(point: GeoPoint) -> JsonObject:
    """Return a position on Earth with the field names of the wire."""
    return {"latitude": point.latitude, "longitude": point.longitude, "altitude": point.altitude}


def _flight_state(report: FlightStateReport) -> Leaves:
    """``twin.flight_state.v1``; an empty mode means not reported."""
    body: JsonObject = {"is_flying": report.is_flying}
    if report.flight_mode:
        body["flight_mode"] = report.flight_mode
    return [("flight_state", body)]


def _flight_controller(report: FlightControllerReport) -> Leaves:
    """``twin.flight_controller.v1``."""
    link = {
        "connected": report.connected,
        "vehicle_sysid": report.system_id,
        "reboots": report.reboots,
    }
    body = {
        "type": "flight_controller",
        "armed": report.armed,
        "mode": report.mode,
        "failsafe": report.failsafe,
        "autopilot": report.autopilot or None,
        "vehicle": report.vehicle or None,
        "custom_mode": report.custom_mode,
        "system_status": report.system_status,
        "ready_to_arm": report.ready_to_arm,
        "status_texts": [{"text": said.text, "severity": said.severity} for said in report.status_texts],
        "link": without_nulls(link),
        "mission": None if report.mission is None else _mission(report.mission),
        "home": None if report.home is None else _place(report.home),
    }
    return [("flight_controller", without_nulls(body))]


def _mission(mission: MissionProgress) -> JsonObject:
    """Return the progress of the autopilot's mission; a total of 0 is omitted."""
    body = {
        "current_seq": mission.current,
        "total": mission.total or None,
        "last_reached_seq": mission.last_reached,
    }
    return without_nulls(body)


def _metrics(report: MetricsReport) -> Leaves:
    """Put the categories inside ``metrics``; nothing when there are none."""
    return [("metrics", {"metrics": report.categories})] if report.categories else []


def _navigation(report: NavigationReport) -> Leaves:
    """One status of one action; the status of a mission has a topic of its own."""
    if report.step is not None:
        return _mission_status(report)
    body: JsonObject = {
        "action_id": report.action_id,
        "status": report.state,
        "progress": min(max(report.progress, 0.0), 100.0),
        "message": report.message,
    }
    return [("navigate/status", body)]


def _mission_status(report: NavigationReport) -> Leaves:
    """One status of one mission; a blocked mission is sent as running.

    A plan that is part of a run is reported as that run, whose own status reports the end.
    """
    run = run_of(report.action_id)
    runs = bool(run) or report.state is ActionState.BLOCKED
    body: JsonObject = {
        "mission_execution_uuid": run or report.action_id,
        "status": ActionState.RUNNING if runs else report.state,
        "current_step": report.step,
        "message": report.message,
    }
    return [("mission/status", body)]


def _telemetry(report: TelemetryReport) -> Leaves:
    """One message of the telemetry topic."""
    return [("telemetry", {**report.fields, "type": report.type})]


def _photo(report: PhotoReport) -> Leaves:
    """One picture; the encoder writes its bytes in base64."""
    body: JsonObject = {
        "image": report.image,
        "format": report.format,
        "width": report.width,
        "height": report.height,
    }
    return [("camera/photo", body)]


def _depth(report: DepthReport, by: MessageSource) -> Leaves:
    """One depth image; the encoder writes its bytes in base64, unless the layout is a list."""
    check_depth(report)
    return [("depth", {"type": "depth_data", **depth_data(report, by.layout)})]


def _pointcloud(report: PointCloudReport) -> Leaves:
    """Point cloud, with all three fields from which different readers take its layout."""
    check_pointcloud(report)
    body: JsonObject = {
        "type": "pointcloud",
        "data": report.points,
        "rows": len(report.points) // (4 * report.stride),
        "cols": report.stride,
        "point_stride": report.stride,
        "timestamp_us": int(finite(report.stamp * 1e6, "timestamp")),
    }
    return [("pointcloud", body)]


def _log(report: LogReport) -> Leaves:
    """One log line; the log store expects upper-case levels."""
    body = {
        "type": "driver_log",
        "message": report.message,
        "level": report.level.upper(),
        "source": "edge",
        **report.about,
    }
    return [("driverlog", body)]


def _event(report: EventReport) -> Leaves:
    """One event; none for kinds that stay in the edge's own history."""
    return [("event", event_body(report))] if report.kind in CLOUD_EVENTS else []


_FORMS: Mapping[type[object], Callable[[Any], Leaves]] = MappingProxyType(
    {
        ScaleReport: _scale,
        BatteryReport: _battery,
        GpsReport: _gps,
        FlightStateReport: _flight_state,
        FlightControllerReport: _flight_controller,
        MetricsReport: _metrics,
        NavigationReport: _navigation,
        TelemetryReport: _telemetry,
        PhotoReport: _photo,
        PointCloudReport: _pointcloud,
        LogReport: _log,
        EventReport: _event,
    }
)
