"""Reports come back from recorded messages as they were."""

import pytest

from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import (
    BatteryReport,
    GpsReport,
    JointReport,
    JointTags,
    LogReport,
    PoseReport,
    TelemetryReport,
)
from fleet.record.messages import report_messages
from fleet.replay.reports import report_in
from fleet.wire.databus import encode_report

T = 1_800_000_000.5


@pytest.mark.parametrize(
    "report",
    [
        PoseReport(T, Vector3(1.0, 2.0, 3.0), Quaternion(1.0, 0.0, 0.0, 0.0), "map"),
        GpsReport(T, GeoPoint(47.0, 8.0, 500.0), "3d", 12, 90.0, 1.5, 2.5),
        GpsReport(T, GeoPoint(47.0, 8.0, 500.0), "3d"),
        GpsReport(T, None, "none", 3),
        JointReport(T, {"a": 1.0, "b": 2.0}, {"a": 0.5}, {"b": 3.0}, JointTags(source_subtype="policy")),
        LogReport(T, "ERROR", "it fell"),
        BatteryReport(T, 50.0, 12.5),
        TelemetryReport(T, "vehicle_state", {"armed": True}),
    ],
    ids=lambda report: type(report).__name__,
)
def test_a_report_comes_back(report):
    messages = report_messages("/yard/rex", report.channel, encode_report(report, 1))
    assert report_in(messages[0].schema, messages[0].payload) == report


def test_what_is_no_report_is_none():
    assert report_in("fleet.RobotState", b"{}") is None


@pytest.mark.parametrize("schema", ["foxglove.PoseInFrame", "fleet.BatteryReport", "foxglove.LocationFix"])
def test_a_damaged_one_is_reported(schema):
    with pytest.raises(ValueError, match="cannot be read"):
        report_in(schema, b'{"timestamp": 1}')
