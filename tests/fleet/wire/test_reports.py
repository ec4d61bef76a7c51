import json
from typing import get_args

import pytest
from cyberwave.data.state_representation import (
    cartesian_pose_from_position_payload,
    cartesian_pose_from_rotation_payload,
    merge_cartesian_pose,
)
from cyberwave.data.state_representation.space.joint import parse_joint_mqtt_payload
from cyberwave.motion import _NAV_TERMINAL_STATUSES
from cyberwave.twin.sensors.gps import normalize_gps_payload
from cyberwave.twin.sensors.imu import normalize_imu_payload
from cyberwave_contracts import MODELS_BY_CONTRACT_ID
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.navigation import ActionState
from fleet.model.report import (
    BatteryReport,
    FlightControllerReport,
    FlightStateReport,
    GpsReport,
    ImuReport,
    JointReport,
    LogReport,
    MetricsReport,
    MissionProgress,
    NavigationReport,
    PointCloudReport,
    PoseReport,
    Report,
    StatusText,
    TelemetryReport,
)
from fleet.wire.reports import sender, to_mqtt
from fleet.wire.rules import CHANNEL_SUFFIXES
from fleet.wire.topics import JOINT_UPDATE, Topics

NAN = float("nan")
TWIN = "6f0c9a1e-3b7d-4c55-9a41-0d6f6f1f2a10"


def sent(report, source_type="edge", session="edge_live_1"):
    """Return the messages of a report by suffix, as a JSON reader sees them."""
    messages = to_mqtt(report, sender(source_type=source_type, session=session))
    return {suffix: json.loads(payload) for suffix, payload in messages}


def seen_pose(before, report):
    """Return the pose that the SDK's readers hold after a report."""
    messages = sent(report)
    pose = merge_cartesian_pose(before, cartesian_pose_from_position_payload(messages["position"]))
    return merge_cartesian_pose(pose, cartesian_pose_from_rotation_payload(messages["rotation"]))


# -- what all messages have ---------------------------------------------------------------------------


@pytest.mark.parametrize("kind", get_args(Report), ids=lambda kind: kind.channel)
@settings(max_examples=20)
@given(data=st.data())
def test_every_message_is_stamped_tagged_and_goes_to_a_topic_of_its_channel(reports, kind, data):
    report = data.draw(reports[kind])
    for suffix, message in sent(report, "sim").items():
        assert suffix in CHANNEL_SUFFIXES[kind.channel]
        assert Topics("p").parse(Topics("p").twin(TWIN, suffix)).suffix == suffix
        assert message["timestamp"] == report.stamp
        assert message["session_id"] == "edge_live_1"
        assert message.get("source_type", "sim") == "sim"


def test_an_empty_session_is_left_out():
    messages = sent(FlightStateReport(1.0, is_flying=True), session="")
    assert "session_id" not in messages["flight_state"]


# -- pose ---------------------------------------------------------------------------------------------


def test_a_pose_has_the_sdks_form_on_two_topics():
    report = PoseReport(5.0, Vector3(1, 2, 3), Quaternion(0.5, -0.5, 0.5, 0.5))
    common = {"source_type": "edge", "timestamp": 5.0, "session_id": "edge_live_1"}
    assert sent(report) == {
        "position": {"type": "position", "position": {"x": 1, "y": 2, "z": 3}, **common},
        "rotation": {"type": "rotation", "rotation": {"w": 0.5, "x": -0.5, "y": 0.5, "z": 0.5}, **common},
    }


def test_a_robot_that_returns_to_the_origin_is_seen_there_by_the_sdk():
    away = seen_pose(None, PoseReport(1.0, Vector3(4, 5, 6), Quaternion(0, 0, 0, 1)))
    home = seen_pose(away, PoseReport(2.0, Vector3(), Quaternion()))
    position, turn = home.position, home.orientation
    assert [position.x, position.y, position.z] == pytest.approx([0, 0, 0], abs=1e-8)
    assert [turn.w, turn.x, turn.y, turn.z] == pytest.approx([1, 0, 0, 0], abs=1e-8)


@given(st.data())
def test_the_sdk_sees_every_pose_whatever_it_held_before(reports, data):
    before = seen_pose(None, PoseReport(1.0, Vector3(4, 5, 6), Quaternion(0, 0, 0, 1)))
    report = data.draw(reports[PoseReport])
    pose = seen_pose(before, report)
    p, r = report.position, report.rotation
    assert [pose.position.x, pose.position.y, pose.position.z] == pytest.approx([p.x, p.y, p.z], abs=2e-9)
    turn = pose.orientation
    assert [turn.w, turn.x, turn.y, turn.z] == pytest.approx([r.w, r.x, r.y, r.z], abs=2e-9)


def test_minus_zero_is_a_zero_too():
    assert any(
        sent(PoseReport(1.0, Vector3(-0.0, -0.0, -0.0), Quaternion()))["position"]["position"].values()
    )


# -- joints -------------------------------------------------------------------------------------------


def test_joints_are_sent_in_the_aggregated_form():
    message = sent(JointReport(1.0, {"hip": 0.5}, {"hip": 0.1}))[JOINT_UPDATE]
    assert message["positions"] == {"hip": 0.5}
    assert message["velocities"] == {"hip": 0.1}
    assert "efforts" not in message
    assert "type" not in message


@given(st.data())
def test_the_sdk_reads_exactly_the_joints_that_were_measured(reports, data):
    report = data.draw(reports[JointReport])
    for message in sent(report).values():
        parsed = parse_joint_mqtt_payload(message)
        assert (parsed.positions, parsed.velocities, parsed.efforts) == (
            report.positions,
            report.velocities,
            report.efforts,
        )
        assert not parsed.target_positions


def test_without_joints_nothing_is_sent():
    assert sent(JointReport(1.0, {})) == {}


# -- schema-checked state -----------------------------------------------------------------------------

CONTRACTS = {
    BatteryReport: ("twin.battery.v1", "battery/status"),
    FlightStateReport: ("twin.flight_state.v1", "flight_state"),
    FlightControllerReport: ("twin.flight_controller.v1", "flight_controller"),
}


@pytest.mark.parametrize("kind", CONTRACTS, ids=lambda kind: kind.channel)
@pytest.mark.parametrize("source_type", ["edge", "sim"])
@given(data=st.data())
def test_what_is_sent_keeps_its_contract(reports, kind, source_type, data):
    contract, suffix = CONTRACTS[kind]
    for at, message in sent(data.draw(reports[kind]), source_type).items():
        assert at == suffix
        MODELS_BY_CONTRACT_ID[contract].model_validate(message)


def test_a_battery_is_reported_in_percent():
    message = sent(BatteryReport(1.0, 80.5, 12.1, 0.4))["battery/status"]
    assert (message["percentage"], message["voltage"], message["current"]) == (80.5, 12.1, 0.4)


def test_a_battery_of_unknown_charge_is_not_reported():
    assert sent(BatteryReport(1.0, None, 12.1)) == {}
    assert "voltage" not in sent(BatteryReport(1.0, 50.0))["battery/status"]


@pytest.mark.parametrize("percent", [-1.0, 100.5, NAN])
def test_a_charge_that_cannot_be_is_refused(percent):
    with pytest.raises(WireError, match="percent: 0 to 100 percent is possible"):
        sent(BatteryReport(1.0, percent))


def test_the_flight_controller_says_what_it_knows_and_no_more():
    message = sent(
        FlightControllerReport(
            1.0,
            armed=True,
            mode="AUTO.LOITER",
            failsafe=False,
            autopilot="px4",
            status_texts=(StatusText("Preflight Fail", 3),),
            system_id=7,
            mission=MissionProgress(2, total=0),
            home=GeoPoint(47.0, 8.0, 400.0),
        )
    )["flight_controller"]
    assert message["type"] == "flight_controller"
    assert message["status_texts"] == [{"text": "Preflight Fail", "severity": 3}]
    assert message["link"] == {"connected": True, "vehicle_sysid": 7, "reboots": 0}
    assert message["mission"] == {"current_seq": 2}
    assert message["home"] == {"latitude": 47.0, "longitude": 8.0, "altitude": 400.0}
    assert not {"vehicle", "custom_mode", "system_status", "ready_to_arm"} & message.keys()


# -- sensors ------------------------------------------------------------------------------------------


def test_a_fix_has_the_names_that_the_sdk_publishes():
    report = GpsReport(1.0, GeoPoint(47.0, 8.0, 400.0), "3d", 12, heading=-90.0, horizontal_accuracy=1.5)
    message = normalize_gps_payload(sent(report)["gps"])
    assert (message["latitude"], message["longitude"], message["altitude"]) == (47.0, 8.0, 400.0)
    assert (message["fix_type"], message["satellite_count"]) == ("3d", 12)
    assert (message["compass_heading"], message["horizontal_accuracy"]) == (270.0, 1.5)
    assert "vertical_accuracy" not in message


def test_without_a_fix_nothing_is_sent():
    assert sent(GpsReport(1.0, GeoPoint(0, 0), "none")) == {}


def test_the_imu_is_what_the_sdks_handle_reads():
    message = normalize_imu_payload(sent(ImuReport(1.0, Vector3(1, 2, 3), Vector3(4, 5, 6)))["imu"])
    assert message["gyro"] == {"x": 1, "y": 2, "z": 3}
    assert message["accel"] == {"x": 4, "y": 5, "z": 6}


# -- events -------------------------------------------------------------------------------------------


def test_metrics_stand_inside_metrics_and_are_stamped():
    message = sent(MetricsReport(3.0, power={"battery_percent": 80, "charging": False}))["metrics"]
    assert message["metrics"] == {"power": {"battery_percent": 80, "charging": False}, "errors": []}
    assert message["timestamp"] == 3.0


@pytest.mark.parametrize("state", ActionState)
def test_a_status_names_its_action_and_the_sdk_takes_the_terminal_ones_for_the_end(state):
    message = sent(NavigationReport(1.0, "a1", state, 40.0, "going"))["navigate/status"]
    assert (message["action_id"], message["status"], message["message"]) == ("a1", state.value, "going")
    assert message["progress"] == 40.0
    # The SDK also gives up on ``blocked``; every state that is terminal for us is one for the SDK.
    expected = state.terminal or state is ActionState.BLOCKED
    assert (message["status"] in _NAV_TERMINAL_STATUSES) == expected


@pytest.mark.parametrize(("progress", "expected"), [(-5.0, 0.0), (130.0, 100.0)])
def test_progress_is_a_percentage(progress, expected):
    assert (
        sent(NavigationReport(1.0, "a", ActionState.RUNNING, progress))["navigate/status"]["progress"]
        == expected
    )


@pytest.mark.parametrize("word", ["connected", "disconnected"])
def test_coming_and_going_carry_no_source_type(word):
    assert "source_type" not in sent(TelemetryReport(1.0, word))["telemetry"]


def test_a_telemetry_field_cannot_pass_for_the_envelope():
    forged = {"type": "telemetry_end", "source_type": "tele", "timestamp": 9, "reason": "pilot"}
    message = sent(TelemetryReport(1.0, "authority_lost", forged))["telemetry"]
    assert message == {
        "type": "authority_lost",
        "reason": "pilot",
        "source_type": "edge",
        "timestamp": 1.0,
        "session_id": "edge_live_1",
    }


def test_a_log_line_has_an_upper_case_level():
    message = sent(LogReport(1.0, "warning", "low battery"))["driverlog"]
    assert (message["type"], message["level"], message["source"]) == ("driver_log", "WARNING", "edge")
    assert message["message"] == "low battery"


# -- numbers that are none ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "report",
    [
        PoseReport(1.0, Vector3(NAN, 0, 0), Quaternion()),
        PoseReport(1.0, Vector3(), Quaternion(NAN)),
        PoseReport(NAN, Vector3(), Quaternion()),
        JointReport(1.0, {"hip": float("inf")}),
        BatteryReport(1.0, 50.0, NAN),
        GpsReport(1.0, GeoPoint(NAN, 0), "3d"),
        GpsReport(1.0, GeoPoint(1, 0), "3d", heading=float("inf")),
        ImuReport(1.0, Vector3(), Vector3(0, 0, NAN)),
        MetricsReport(1.0, power={"voltage": NAN}),
        NavigationReport(1.0, "a", ActionState.RUNNING, NAN),
        TelemetryReport(1.0, "vehicle_state", {"list": [1.0, NAN]}),
    ],
)
def test_a_number_that_is_not_finite_never_leaves(report):
    with pytest.raises(WireError, match="not a finite number"):
        to_mqtt(report, sender(source_type="edge", session="s"))


def test_a_null_that_was_meant_is_sent():
    assert sent(TelemetryReport(1.0, "vehicle_state", {"goal": None}))["telemetry"]["goal"] is None


@pytest.mark.parametrize("stamp", [NAN, float("inf"), 1e305])
def test_points_of_no_time_are_refused(stamp):
    with pytest.raises(WireError, match="timestamp: a finite number is needed"):
        sent(PointCloudReport(stamp, b"", 3))
