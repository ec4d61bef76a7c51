"""What programs write to the bus as they would publish it on MQTT arrives as they wrote it."""

import json

import pytest

from fleet.errors import WireError
from fleet.model.report import LogReport, MetricsReport, TelemetryReport
from fleet.wire.databus import decode_report
from fleet.wire.reports import sender, to_mqtt
from fleet.wire.samples import json_sample

BY = sender(source_type="edge", session="us")
TAGS = {"source_type": "edge", "session_id": "us", "timestamp": 5.0}
LOAD = {"loaded": True, "weight_kg": 12.5, "load_id": "p-7"}
LINE = {
    "type": "driver_log",
    "message": "lidar ready",
    "level": "info",
    "container_name": "cyberwave-driver-1",
    "source": "edge_core",
    "timestamp": 5.0,
    "edge_core_version": "1.2",
    "sdk_version": "0.7.4",
    "driver_image": "acme/driver:3",
}
"""A line as the reference publishes it."""


def published(channel, message):
    """Return what the cloud gets of a message on the bus."""
    sample = message if isinstance(message, bytes) else json.dumps(message).encode()
    ((_, payload),) = to_mqtt(decode_report(channel, sample), BY)
    return json.loads(payload)


@pytest.mark.parametrize(
    "message",
    [
        {"timestamp": 5.0, "metrics": {"load": LOAD}},
        {"ts": 5.0, "load": LOAD},
        {"type": "metrics", "source_type": "tele", "load": LOAD},
    ],
)
def test_free_form_categories_cross_and_nothing_is_said_about_errors(message):
    assert published("metrics", {**message, "ts": 5.0})["metrics"] == {"load": LOAD}


def test_the_published_form_of_metrics_crosses_whole():
    metrics = {
        "power": {"battery_percent": 80, "charging": False},
        "navigation": {"status": "running", "distance_remaining_m": 3.5, "eta_seconds": 9},
        "load": LOAD,
        "errors": [{"code": 7}],
        "fan": 5,
        "words": ["a"],
    }
    assert published("metrics", {"timestamp": 5.0, "metrics": metrics}) == {"metrics": metrics, **TAGS}


@pytest.mark.parametrize(
    "metrics", [{"errors": ["hot", "low"]}, {"power": 5}, {"errors": None, "navigation": "x"}]
)
def test_a_category_of_any_shape_crosses(metrics):
    assert published("metrics", {"ts": 5.0, **metrics})["metrics"] == {
        name: value for name, value in metrics.items() if value is not None
    }


def test_metrics_that_tell_nothing_are_not_sent():
    assert to_mqtt(decode_report("metrics", b'{"ts": 5.0, "metrics": {}}'), BY) == []


def test_telemetry_fields_beside_the_type_pass():
    stored = {"type": "camera_segment_stored", "recording_id": "r-1", "chunk_index": 3, "is_final": False}
    assert published("telemetry", {**stored, "ts": 5.0}) == {**stored, **TAGS}
    assert published(
        "telemetry", {"ts": 5.0, "type": "camera_stored", "fields": {"recording_id": "r-1"}}
    ) == {
        "type": "camera_stored",
        "recording_id": "r-1",
        **TAGS,
    }


def test_a_sync_frame_keeps_the_session_of_its_stream_and_nothing_else_keeps_one():
    frame = {"type": "camera_sync_frame", "timestamp": 5.0, "session_id": "c_front", "pts": 3}
    assert published("telemetry", frame)["session_id"] == "c_front"
    assert published("telemetry", {**frame, "type": "camera_stored"})["session_id"] == "us"


def test_a_published_log_line_crosses_with_what_it_tells_of_its_sayer():
    assert published("driverlog", LINE) == {**LINE, "level": "INFO", **TAGS}


@pytest.mark.parametrize("channel", ["telemetry", "metrics", "driverlog"])
def test_the_header_stamps_what_has_no_stamp_of_its_own(channel):
    message = {"type": "camera_stored", "message": "x", "level": "INFO", "load": LOAD}
    sample = json_sample(json.dumps(message).encode(), stamp=5.0, sequence=1)
    assert published(channel, sample)["timestamp"] == 5.0
    with pytest.raises(WireError, match="timestamp: is missing"):
        published(channel, message)


@pytest.mark.parametrize(
    ("channel", "message", "why"),
    [
        ("telemetry", {}, "type: is missing"),
        ("telemetry", {"type": 5}, "type: a string"),
        ("telemetry", {"type": "x", "fields": 5}, "fields: an object"),
        ("metrics", {"metrics": 5}, "metrics: an object"),
        ("driverlog", {"level": "INFO"}, "message: is missing"),
        ("driverlog", {"level": "LOUD", "message": "x"}, "level: one of"),
    ],
)
def test_what_lacks_what_its_readers_need_is_refused_with_the_place(channel, message, why):
    with pytest.raises(WireError, match=why):
        published(channel, {"ts": 5.0, **message})


def test_the_reports_of_the_host_say_the_same_as_before():
    report = MetricsReport(5.0, power={"voltage": 12.0})
    assert json.loads(to_mqtt(report, BY)[0][1])["metrics"] == {"errors": [], "power": {"voltage": 12.0}}
    assert json.loads(to_mqtt(LogReport(5.0, "warning", "x"), BY)[0][1])["source"] == "edge"
    assert json.loads(to_mqtt(TelemetryReport(5.0, "connected"), BY)[0][1]).keys() == {
        "type",
        "timestamp",
        "session_id",
    }
