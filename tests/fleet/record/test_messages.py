"""Reports as recorded messages: Foxglove's forms by Foxglove's own schemas, all others by ours."""

import json
import math

import jsonschema
import pytest

from fleet.model.event import EventKind, EventReport
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import (
    BatteryReport,
    DepthReport,
    FlightControllerReport,
    GpsReport,
    ImuReport,
    JointReport,
    JointTags,
    LogReport,
    PhotoReport,
    PoseReport,
    TelemetryReport,
)
from fleet.model.site import Placement
from fleet.record.messages import placement_message, report_messages
from fleet.record.schemas import schema_of
from fleet.wire.databus import encode_report

POSE = PoseReport(10.25, Vector3(1.0, 2.0, 3.0), Quaternion(), "map")
FIX = GpsReport(10.25, GeoPoint(47.0, 8.0, 400.0), "3d", 12, 90.0, 2.0, 3.0)
JOINTS = JointReport(10.25, {"hip": 0.5, "knee": 1.0}, {"hip": 0.1}, tags=JointTags(role="leader"))
LINE = LogReport(10.25, "WARNING", "low voltage", {"driver_image": "x"})
REPORTS = [
    POSE,
    FIX,
    JOINTS,
    LINE,
    GpsReport(10.25, None, "none"),
    BatteryReport(10.25, 80.0),
    ImuReport(10.25, Vector3(), Vector3()),
    FlightControllerReport(10.25, True, "GUIDED", False, home=GeoPoint(47.0, 8.0, 400.0)),
    TelemetryReport(10.25, "connected", {"x": None}),
    PhotoReport(10.25, b"\xff\xd8", "jpeg", 1, 1),
    DepthReport(10.25, b"\0\0", 1, 1, "uint16"),
    EventReport(10.25, EventKind.HEALTH, "it is degraded"),
]


def recorded(report):
    """Return the messages of a report, as they come from the bus."""
    return report_messages("/yard-1/rex", report.channel, encode_report(report, 1))


def body(report, schema):
    """Return the one message of a report with a schema."""
    (found,) = [json.loads(each.payload) for each in recorded(report) if each.schema == schema]
    return found


@pytest.mark.parametrize("report", REPORTS, ids=lambda report: type(report).__name__)
def test_each_report_is_recorded_as_its_schema_says(report):
    messages = recorded(report)
    assert {message.stamp for message in messages} == {10.25}
    for message in messages:
        jsonschema.validate(json.loads(message.payload), json.loads(schema_of(message.schema)))


def test_a_pose_is_recorded_with_its_frame_and_as_a_transform():
    pose, moved = body(POSE, "foxglove.PoseInFrame"), body(POSE, "foxglove.FrameTransform")
    assert (pose["timestamp"], pose["frame_id"]) == ({"sec": 10, "nsec": 250_000_000}, "yard-1/rex/world")
    assert pose["pose"]["position"] == moved["translation"] == {"x": 1.0, "y": 2.0, "z": 3.0}
    assert (moved["parent_frame_id"], moved["child_frame_id"]) == ("yard-1/rex/world", "yard-1/rex")


@pytest.mark.parametrize("stamp", [-1.0, 1e300])
def test_a_stamp_that_is_no_time_is_zero_in_foxglove(stamp):
    pose = body(PoseReport(stamp, Vector3(), Quaternion()), "foxglove.PoseInFrame")
    assert pose["timestamp"] == {"sec": 0, "nsec": 0}


def test_the_world_of_a_robot_is_placed_in_the_site_frame():
    message = placement_message("/yard-1/rex", Placement(Vector3(5.0), math.pi), 10.0)
    placed = json.loads(message.payload)
    jsonschema.validate(placed, json.loads(schema_of(message.schema)))
    assert (placed["parent_frame_id"], placed["child_frame_id"]) == ("site", "yard-1/rex/world")
    assert placed["rotation"]["z"] == pytest.approx(1.0)


def test_a_fix_has_its_accuracy_heading_and_kind():
    fix = body(FIX, "foxglove.LocationFix")
    assert fix["position_covariance"] == [4.0, 0, 0, 0, 4.0, 0, 0, 0, 9.0]
    assert fix["heading"] == pytest.approx(math.pi / 2)
    assert {"key": "satellites", "value": "12"} in fix["metadata"]


def test_a_receiver_without_a_fix_is_recorded_without_a_position():
    (message,) = recorded(GpsReport(10.25, None, "none"))
    assert (message.topic, message.schema) == ("/yard-1/rex/gps/no_fix", "fleet.GpsReport")


def test_joints_that_were_not_measured_have_no_value():
    joints = body(JOINTS, "foxglove.JointStates")["joints"]
    assert joints == [{"name": "hip", "position": 0.5, "velocity": 0.1}, {"name": "knee", "position": 1.0}]


def test_a_line_of_a_log_has_the_level_of_foxglove():
    line = body(LINE, "foxglove.Log")
    assert (line["level"], line["message"], line["name"]) == (3, "low voltage", "yard-1/rex")


@pytest.mark.parametrize(
    ("channel", "sample", "topic", "schema"),
    [
        ("model_output", b'{"label": "dog", "timestamp": 3.0}', "model_output/document", "fleet.Document"),
        ("frames", b"\x01\x02", "frames/unread", "fleet.Unread"),
        ("position", b'{"x": "far"}', "position/document", "fleet.Document"),
    ],
)
def test_what_is_no_report_is_kept_as_it_is(channel, sample, topic, schema):
    (message,) = report_messages("/yard-1/rex", channel, sample)
    assert (message.topic, message.schema) == (f"/yard-1/rex/{topic}", schema)
    jsonschema.validate(json.loads(message.payload), json.loads(schema_of(schema)))
