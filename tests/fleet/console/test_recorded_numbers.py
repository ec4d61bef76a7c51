"""Recorded numbers have the names and values that they had live."""

import msgspec
import pytest

from fleet.console.numbers import numbers_in, numbers_in_state
from fleet.console.recorded_numbers import recorded_numbers
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.navigation import ActionState
from fleet.model.report import (
    BatteryReport,
    DepthReport,
    FlightControllerReport,
    GpsReport,
    ImuReport,
    JointReport,
    LogReport,
    MetricsReport,
    MissionProgress,
    NavigationReport,
    PoseReport,
    TelemetryReport,
)
from fleet.model.state import RobotState
from fleet.record.reading import ReadMessage
from fleet.record.samples import SampleReader
from fleet.wire.databus import encode_report

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
T = 1_800_000_000.5
STATE = RobotState("rex", TWIN, "toy", "yard", T, speed=0.75)


def recorded(key, sample):
    """Return the numbers in what the recorder makes of a sample."""
    reader = SampleReader()
    reader.read("yard", "fleet/yard/robots/rex/state", msgspec.json.encode(STATE))
    found = {}
    for each in reader.read("yard", key, sample):
        found |= recorded_numbers(ReadMessage(each.topic, each.schema, T, T, each.payload))
    return found


REPORTS = [
    PoseReport(T, Vector3(1.0, 2.0, 3.0), Quaternion(0.5, 0.5, 0.5, 0.5), "map"),
    GpsReport(T, GeoPoint(47.0, 8.0, 500.0), "3d", 12, 90.0, 1.5, 2.5),
    GpsReport(T, None, "none", 3),
    JointReport(T, {"a": 1.0, "b": 2.0}, {"a": 0.5}, {"b": 3.0}),
    BatteryReport(T, 50.0, 12.5),
    ImuReport(T, Vector3(0.1, 0.2, 0.3), Vector3(0.0, 0.0, 9.8)),
    FlightControllerReport(T, True, "AUTO", False, system_id=3, mission=MissionProgress(4, 9)),
    MetricsReport(T, power={"cells": [3.7, 3.8]}, more={"load": {"cpu": 0.4}}),
    NavigationReport(T, "a1", ActionState.RUNNING, 0.5, remaining=12.0),
    TelemetryReport(T, "vehicle_state", {"throttle": 0.2}),
]


@pytest.mark.parametrize("report", REPORTS, ids=lambda report: type(report).__name__)
def test_the_numbers_of_a_report_are_those_of_the_live_page(report):
    key, sample = f"cw/{TWIN}/data/{report.channel}", encode_report(report, 1)
    live = numbers_in(key, sample)
    assert live
    assert recorded(key, sample) == pytest.approx(live)


def test_a_sensor_and_a_message_that_is_no_report_keep_their_names():
    for key in (f"cw/{TWIN}/data/metrics/left", f"cw/{TWIN}/data/odd", f"cw/{TWIN}/data/odd/left"):
        sample = b'{"ts": 5.0, "more": {"level": 3}}'
        assert recorded(key, sample) == numbers_in(key, sample) != {}


def test_the_speed_is_that_of_the_state():
    found = recorded("fleet/yard/robots/rex/state", msgspec.json.encode(STATE))
    assert found == numbers_in_state(STATE) == {"speed": 0.75}


@pytest.mark.parametrize(
    ("key", "sample"),
    [
        (f"cw/{TWIN}/data/depth", encode_report(DepthReport(T, b"\0\0", 1, 1, "uint16"), 1)),
        (f"cw/{TWIN}/data/driverlog", encode_report(LogReport(T, "ERROR", "x", {"pid": 3}), 1)),
        (f"cw/{TWIN}/data/commands/velocity", b'{"linear_x": 1}'),
        (f"cw/{TWIN}/data/battery", b"\xff\x00garbage"),
        ("fleet/yard/places/main", b'{"robots": 5}'),
    ],
)
def test_what_has_no_numbers_live_has_none_recorded(key, sample):
    assert recorded(key, sample) == numbers_in(key, sample) == {}


@pytest.mark.parametrize("schema", ["fleet.BatteryReport", "fleet.RobotState", "foxglove.PoseInFrame"])
def test_a_damaged_one_is_reported(schema):
    with pytest.raises(ValueError, match="cannot be read"):
        recorded_numbers(ReadMessage("/yard/rex/battery", schema, T, T, b'{"stamp": [}'))
