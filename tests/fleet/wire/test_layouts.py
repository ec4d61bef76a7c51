"""Topics with several published layouts, of which fleet.yaml chooses one; as the SDK's readers see them."""

import base64
import json

import numpy as np
import pytest
from cyberwave.data.state_representation.space.joint import parse_joint_mqtt_payload
from cyberwave_contracts import SourceTypeEnvelopeV1
from pydantic import ValidationError

from fleet.errors import WireError
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import DepthReport, JointReport, JointTags, PoseReport
from fleet.robot_config import AdapterConfig
from fleet.wire.databus import decode_report
from fleet.wire.reports import sender, to_mqtt
from fleet.wire.rules import LAYOUTS

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
JOINTS = JointReport(5.0, {"hip": 0.5, "knee": -0.25}, {"hip": 1.0}, {"knee": 2.0})
TAGS = JointTags("rl_policy", "w-1", [{"track_id": "t", "sensor_id": "front", "frame_count": 7}])
IMAGE = np.array([[1, 2, 3], [4, 5, 65535]], dtype="<u2")
DEPTH = DepthReport(5.0, IMAGE.tobytes(), 3, 2, "uint16", "front")


def published(report, layout=""):
    """Return the messages that a report becomes, (suffix, message)."""
    by = sender(source_type="edge", session="us", layout=layout)
    messages = [(suffix, json.loads(payload)) for suffix, payload in to_mqtt(report, by)]
    for _, message in messages:
        SourceTypeEnvelopeV1.model_validate(message)
        assert (message["session_id"], message["timestamp"]) == ("us", 5.0)
    return messages


def joints(layout, report=JOINTS):
    return [message for suffix, message in published(report, layout) if suffix == "joint:update"]


@pytest.mark.parametrize("layout", ["", "aggregated"])
def test_the_usual_layout_of_joints_is_aggregated(layout):
    (message,) = joints(layout)
    seen = parse_joint_mqtt_payload(message)
    assert (seen.positions, seen.velocities, seen.efforts) == (
        {"hip": 0.5, "knee": -0.25},
        {"hip": 1.0},
        {"knee": 2.0},
    )


def test_the_flat_layout_has_each_joint_at_the_top_and_the_sdk_sees_no_other():
    (message,) = joints("flat")
    assert (message["hip"], message["knee"]) == (0.5, -0.25)
    assert parse_joint_mqtt_payload(message).positions == JOINTS.positions
    (message,) = joints("flat", JointReport(5.0, {"hip": 0.5}, tags=TAGS))
    assert parse_joint_mqtt_payload(message).positions == {"hip": 0.5}


@pytest.mark.parametrize("name", ["timestamp", "type", "positions", "source_type"])
def test_a_joint_that_the_flat_layout_cannot_tell_from_other_fields_is_refused(name):
    with pytest.raises(WireError, match=f"can be called '{name}'"):
        joints("flat", JointReport(5.0, {name: 0.5}))


def test_the_single_layout_has_a_message_for_each_joint():
    messages = joints("single")
    assert [message["joint_name"] for message in messages] == ["hip", "knee"]
    seen = [parse_joint_mqtt_payload(message) for message in messages]
    assert [each.positions for each in seen] == [{"hip": 0.5}, {"knee": -0.25}]
    assert (seen[0].velocities, seen[1].efforts) == ({"hip": 1.0}, {"knee": 2.0})
    assert messages[0]["type"] == "joint_state"


@pytest.mark.parametrize("layout", ["single", "flat"])
def test_the_older_topic_of_joints_is_always_aggregated(layout):
    (message,) = [message for suffix, message in published(JOINTS, layout) if suffix == "joint_states"]
    assert message["positions"] == JOINTS.positions


@pytest.mark.parametrize("layout", LAYOUTS["joint:update"])
def test_who_moves_the_joints_and_what_is_seen_then_goes_along(layout):
    for message in joints(layout, JointReport(5.0, {"hip": 0.5}, tags=TAGS)):
        assert (message["source_subtype"], message["workload_uuid"]) == ("rl_policy", "w-1")
        assert message["camera_frame_counters"] == TAGS.camera_frame_counters


def test_what_a_program_on_the_bus_tells_with_its_joints_reaches_the_cloud():
    sample = {
        "ts": 5.0,
        "names": ["hip"],
        "positions": [0.5],
        "source_subtype": "vla",
        "workload_uuid": "w-2",
    }
    (message,) = joints("", decode_report("joint_states", json.dumps(sample).encode()))
    assert (message["source_subtype"], message["workload_uuid"]) == ("vla", "w-2")
    assert message["positions"] == {"hip": 0.5}


def test_the_name_of_a_frame_goes_with_a_pose_and_its_turn_and_is_left_out_when_there_is_none():
    sample = {"ts": 5.0, "x": 1, "y": 2, "z": 3, "qx": 0, "qy": 0, "qz": 0, "qw": 1, "frame_id": "map"}
    named = published(decode_report("position", json.dumps(sample).encode()))
    assert [(suffix, message["frame_id"]) for suffix, message in named] == [
        ("position", "map"),
        ("rotation", "map"),
    ]
    assert all(
        "frame_id" not in message for _, message in published(PoseReport(5.0, Vector3(1), Quaternion()))
    )


def test_a_depth_image_has_every_published_layout():
    ((_, usual),) = published(DEPTH)
    assert base64.b64decode(usual["data"]["depth_binary"]) == DEPTH.image
    ((_, older),) = published(DEPTH, "string")
    assert base64.b64decode(older["data"]) == DEPTH.image
    ((_, listed),) = published(DEPTH, "list")
    assert listed["data"] == IMAGE.flatten().tolist()
    for message in (older, listed):
        assert (message["type"], message["width"], message["height"], message["dtype"]) == (
            "depth_data",
            3,
            2,
            "uint16",
        )


def test_a_list_of_metres_is_not_published():
    with pytest.raises(WireError, match="a list holds uint16"):
        published(DepthReport(5.0, b"1234", 1, 1, "float32"), "list")


@pytest.mark.parametrize(("name", "suffix"), [("joint/update", "joint:update"), ("depth", "depth")])
def test_fleet_yaml_chooses_the_layout(name, suffix):
    for layout in LAYOUTS[suffix]:
        config = AdapterConfig(name="rex", twin=TWIN, rules={name: {"layout": layout}})
        assert config.changes().outward[suffix].layout == layout


@pytest.mark.parametrize(("name", "layout"), [("joint/update", "list"), ("depth", "flat"), ("gps", "flat")])
def test_a_layout_that_a_topic_does_not_have_is_refused(name, layout):
    with pytest.raises(ValidationError, match=f"{name} has no layout '{layout}'"):
        AdapterConfig(name="rex", twin=TWIN, rules={name: {"layout": layout}})
