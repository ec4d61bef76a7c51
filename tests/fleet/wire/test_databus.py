import json
import struct
from typing import get_args

import pytest
from cyberwave.data.api import _permissive_decode
from cyberwave.data.backend import Sample
from cyberwave.data.header import HeaderMeta, HeaderTemplate, decode, encode
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.errors import WireError
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
    NavigationReport,
    PointCloudReport,
    PoseReport,
    Report,
    TelemetryReport,
)
from fleet.wire.databus import decode_report, encode_report
from fleet.wire.samples import json_payload

POSE = PoseReport(1760000000.25, Vector3(1, 2, 3), Quaternion(0.5, 0.5, -0.5, 0.5))
JOINTS = JointReport(2.0, {"a": 1.0, "b": 2.0}, {"b": 0.5}, {})


def as_the_sdk_reads(report, sequence=0):
    sample = Sample(channel=report.channel, payload=encode_report(report, sequence), timestamp=0.0)
    return _permissive_decode(sample)


@pytest.mark.parametrize("kind", get_args(Report), ids=lambda kind: kind.channel)
@given(data=st.data(), sequence=st.integers(0, 2**62))
def test_every_report_comes_back_as_it_was_sent(reports, kind, data, sequence):
    report = data.draw(reports[kind])
    assert decode_report(kind.channel, encode_report(report, sequence)) == report


JSON_KINDS = [kind for kind in get_args(Report) if kind not in (DepthReport, PointCloudReport)]


@pytest.mark.parametrize("kind", JSON_KINDS, ids=lambda kind: kind.channel)
@settings(max_examples=10)
@given(data=st.data())
def test_the_sdk_reads_every_report_with_its_stamp(reports, kind, data):
    report = data.draw(reports[kind])
    assert as_the_sdk_reads(report)["ts"] == report.stamp


def test_the_header_is_byte_for_byte_the_sdks():
    ours = encode_report(POSE, 7)
    header, payload = decode(ours)
    assert (header.content_type, header.ts, header.seq) == ("application/json", POSE.stamp, 7)
    assert encode(header, payload) == ours
    template = HeaderTemplate("application/json")
    assert template.pack(payload, ts=POSE.stamp) == encode_report(POSE, 0)
    assert struct.unpack_from("<I", ours) == (51,)


def test_documented_payloads_have_their_documented_fields():
    assert as_the_sdk_reads(POSE) == {
        "ts": POSE.stamp,
        "x": 1,
        "y": 2,
        "z": 3,
        "qx": 0.5,
        "qy": -0.5,
        "qz": 0.5,
        "qw": 0.5,
    }
    assert as_the_sdk_reads(BatteryReport(1.0, 80.0, 12.1, 0.4)) == {
        "ts": 1.0,
        "voltage_v": 12.1,
        "current_a": 0.4,
        "charge_pct": 80.0,
    }
    assert as_the_sdk_reads(ImuReport(1.0, Vector3(1, 2, 3), Vector3(4, 5, 6))) == {
        "ts": 1.0,
        "accel": {"x": 4, "y": 5, "z": 6},
        "gyro": {"x": 1, "y": 2, "z": 3},
    }


def test_joints_are_arrays_in_the_order_of_their_names():
    assert as_the_sdk_reads(JOINTS) == {
        "ts": 2.0,
        "names": ["a", "b"],
        "positions": [1.0, 2.0],
        "velocities": [None, 0.5],
    }


def test_an_unknown_value_is_left_out_and_not_sent_as_zero():
    assert as_the_sdk_reads(BatteryReport(1.0, voltage=12.1)) == {"ts": 1.0, "voltage_v": 12.1}


def test_gps_has_the_names_of_its_topic():
    report = GpsReport(1.0, GeoPoint(47.4, 8.5, 500.0), "3d", satellites=12)
    assert as_the_sdk_reads(report) == {
        "ts": 1.0,
        "latitude": 47.4,
        "longitude": 8.5,
        "altitude": 500.0,
        "fix_type": "3d",
        "satellite_count": 12,
    }


def test_the_state_of_an_action_is_its_word():
    report = NavigationReport(1.0, "a1", ActionState.RUNNING, 40.0)
    assert as_the_sdk_reads(report)["state"] == "running"


def test_what_the_sdk_publishes_is_read():
    payload = json.dumps({"ts": 5, "x": 1, "y": 2, "z": 3, "qx": 0, "qy": 0, "qz": 0, "qw": 1, "source": "w"})
    expected = PoseReport(5.0, Vector3(1, 2, 3), Quaternion())
    assert decode_report("position", HeaderTemplate("application/json").pack(payload.encode())) == expected
    assert decode_report("position", payload.encode()) == expected
    meta = HeaderMeta("application/json", 1.0, 3, metadata={"frame": "map"})
    assert decode_report("position", encode(meta, payload.encode())) == expected


@pytest.mark.parametrize(
    ("report", "where"),
    [
        (PoseReport(1.0, Vector3(float("nan")), Quaternion()), "x"),
        (PoseReport(float("inf"), Vector3(), Quaternion()), "ts"),
        (JointReport(1.0, {"hip": float("-inf")}), "positions.0"),
        (BatteryReport(1.0, voltage=float("nan")), "voltage_v"),
        (TelemetryReport(1.0, "vehicle_state", {"deep": [{"n": float("nan")}]}), "fields.deep.0.n"),
    ],
)
def test_a_number_that_is_not_finite_is_refused_with_its_place(report, where):
    with pytest.raises(WireError, match="not a finite number") as refusal:
        encode_report(report, 0)
    assert refusal.value.where == where


@pytest.mark.parametrize("value", [object(), "\ud800", {(1, 2): 3}])
def test_what_json_cannot_hold_is_refused(value):
    with pytest.raises(WireError, match="cannot be sent as JSON"):
        encode_report(TelemetryReport(1.0, "x", {"v": value}), 0)


def test_a_velocity_of_a_joint_without_a_position_is_refused():
    with pytest.raises(WireError, match="'knee' has no position"):
        encode_report(JointReport(1.0, {"hip": 1.0}, {"knee": 1.0}), 0)


@pytest.mark.parametrize(
    ("channel", "payload"),
    [
        ("position", {"ts": 1, "x": 1, "y": 2, "z": 3}),
        ("position", {"ts": 1, "x": "1", "y": 2, "z": 3, "qx": 0, "qy": 0, "qz": 0, "qw": 1}),
        ("position", {"ts": 1, "x": True, "y": 2, "z": 3, "qx": 0, "qy": 0, "qz": 0, "qw": 1}),
        ("imu", {"ts": 1, "accel": {"x": 1}, "gyro": {"x": 1, "y": 2, "z": 3}}),
        ("joint_states", {"ts": 1, "names": ["a"], "positions": [1, 2]}),
        ("joint_states", {"ts": 1, "names": ["a", "a"], "positions": [1, 2]}),
        ("joint_states", {"ts": 1, "names": ["a"], "positions": [1], "efforts": [1, 2]}),
        ("navigate_status", {"ts": 1, "action_id": "a", "state": "flying"}),
        ("battery", {"charge_pct": 5}),
        ("battery", []),
    ],
)
def test_a_payload_of_the_wrong_shape_is_refused_with_the_channel(channel, payload):
    with pytest.raises(WireError) as refusal:
        decode_report(channel, json.dumps(payload).encode())
    assert refusal.value.where in {channel, ""}


@pytest.mark.parametrize("payload", [b'{"ts": NaN}', b'{"ts": 1e999}', b'{"ts": Infinity}', b'{"ts": null}'])
def test_a_stamp_that_is_no_number_is_refused(payload):
    with pytest.raises(WireError):
        decode_report("battery", payload)


def test_an_unknown_channel_is_refused():
    with pytest.raises(WireError, match="no report has the channel 'frames'"):
        decode_report("frames", b"{}")


def test_a_sample_that_is_not_json_is_refused_by_its_content_type():
    array = encode(HeaderMeta("numpy/ndarray", 1.0, shape=(2, 3), dtype="float32"), b"\0" * 24)
    with pytest.raises(WireError, match="'numpy/ndarray' is not JSON"):
        json_payload(array)


def test_local_setpoints_are_read_with_and_without_a_header():
    body = b'{"linear_x":0.2}'
    assert json_payload(body) == body
    assert json_payload(HeaderTemplate("application/json").pack(body)) == body


def test_no_hostile_bytes_raise_anything_but_a_wire_error(hostile):
    mission = FlightControllerReport(1.0, True, "AUTO", False)
    telemetry = TelemetryReport(1.0, "driver_info", {"a": [1, {"b": "\N{ROCKET}"}]})
    depth = DepthReport(1.0, b"1234", 2, 1, "uint16", "front")
    cloud = PointCloudReport(1.0, b"123456789012", 3)
    sent = [POSE, JOINTS, BatteryReport(1.0, 5.0), ImuReport(1.0, Vector3(), Vector3()), mission, telemetry]
    sent += [depth, cloud]
    kinds = [kind.channel for kind in get_args(Report)]
    read = 0
    for index, sample in enumerate(hostile(encode_report(report, 1) for report in sent)):
        try:
            decode_report(kinds[index % len(kinds)], sample)
            read += 1
        except WireError:
            continue
    assert read > 40


@given(st.sampled_from([kind.channel for kind in get_args(Report)]), st.binary(max_size=120))
def test_arbitrary_bytes_are_refused(channel, sample):
    with pytest.raises(WireError):
        decode_report(channel, sample)


def test_deeply_nested_fields_are_refused_without_a_recursion_error():
    deep = b'{"ts":1,"type":"x","fields":{"a":' + b"[" * 200_000 + b"]" * 200_000 + b"}}"
    with pytest.raises(WireError):
        decode_report("telemetry", deep)
