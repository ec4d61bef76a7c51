"""The messages of the most frequent reports: the same fields as by dict, and no zero that readers ignore."""

import json

import msgspec
import pytest

from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import ImuReport, JointReport, JointTags, PoseReport
from fleet.wire.reports import sender
from fleet.wire.states import NUDGE, STATES
from fleet.wire.topics import JOINT_UPDATE

EDGE = sender(source_type="edge", session="s", sensor="front")
BARE = sender(source_type="sim", session="")


def messages(report, by=BARE):
    """Return the messages of a report as a JSON reader sees them, in order."""
    return [
        (suffix, json.loads(msgspec.json.encode(each))) for suffix, each in STATES[type(report)](report, by)
    ]


def test_a_pose_goes_to_two_topics_with_the_fields_that_every_message_has():
    (first, position), (second, rotation) = messages(
        PoseReport(5.0, Vector3(1, 2, 3), Quaternion(0.5, 0.5, -0.5, 0.5), "map"), EDGE
    )
    common = {
        "source_type": "edge",
        "timestamp": 5.0,
        "session_id": "s",
        "sensor_id": "front",
        "frame_id": "map",
    }
    assert (first, second) == ("position", "rotation")
    assert position == {**common, "type": "position", "position": {"x": 1, "y": 2, "z": 3}}
    assert rotation == {**common, "type": "rotation", "rotation": {"w": 0.5, "x": 0.5, "y": -0.5, "z": 0.5}}


def test_fields_that_are_not_given_are_left_out():
    (_, position), (_, rotation) = messages(PoseReport(5.0, Vector3(1, 2, 3), Quaternion(0, 0, 0, 1)))
    for message in (position, rotation):
        assert message.keys() - {"position", "rotation"} == {"type", "source_type", "timestamp"}


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_the_origin_and_the_identity_are_moved_by_a_hair_because_readers_ignore_them(zero):
    (_, position), (_, rotation) = messages(PoseReport(5.0, Vector3(zero, 0, 0), Quaternion(1, 0, zero, 0)))
    assert position["position"] == {"x": NUDGE, "y": 0, "z": 0}
    assert rotation["rotation"] == {"w": 1, "x": 0, "y": 0, "z": NUDGE}


@pytest.mark.parametrize("place", [Vector3(x=NUDGE), Vector3(y=1e-300), Vector3(z=-1)])
def test_any_other_place_is_sent_as_it_is(place):
    (_, position), _ = messages(PoseReport(5.0, place, Quaternion()))
    assert position["position"] == {"x": place.x, "y": place.y, "z": place.z}


def test_a_turn_of_minus_one_is_sent_as_it_is():
    _, (_, rotation) = messages(PoseReport(5.0, Vector3(), Quaternion(w=-1.0)))
    assert rotation["rotation"] == {"w": -1, "x": 0, "y": 0, "z": 0}


def test_joints_go_to_two_topics_in_the_aggregated_form():
    whole = JointReport(5.0, {"hip": 0.5}, {"hip": 0.1}, {"hip": 2.0})
    (first, message), (second, same) = messages(whole, EDGE)
    assert (first, second, same) == (JOINT_UPDATE, "joint_states", message)
    assert message == {
        "source_type": "edge",
        "timestamp": 5.0,
        "session_id": "s",
        "sensor_id": "front",
        "positions": {"hip": 0.5},
        "velocities": {"hip": 0.1},
        "efforts": {"hip": 2.0},
    }


@pytest.mark.parametrize(
    ("velocities", "efforts", "fields"),
    [({}, {}, set()), ({"hip": 0.0}, {}, {"velocities"}), ({}, {"hip": 1.0}, {"efforts"})],
)
def test_what_is_not_measured_of_joints_is_left_out(velocities, efforts, fields):
    (_, message), _ = messages(JointReport(5.0, {"hip": 0.0}, velocities, efforts))
    assert message.keys() == {"source_type", "timestamp", "positions"} | fields


def test_without_joints_nothing_is_sent():
    assert messages(JointReport(5.0, {}, {"hip": 1.0}, {"hip": 1.0})) == []


@pytest.mark.parametrize("layout", ["single", "flat"])
def test_another_layout_of_joints_is_followed(layout):
    by = msgspec.structs.replace(EDGE, layout=layout)
    (first, message), (second, whole) = messages(JointReport(5.0, {"hip": 0.5}), by)
    assert (first, second, whole["positions"]) == (JOINT_UPDATE, "joint_states", {"hip": 0.5})
    assert "positions" not in message


def test_joints_of_a_leader_say_so():
    (_, message), _ = messages(JointReport(5.0, {"hip": 0.5}, tags=JointTags(role="leader")), EDGE)
    assert message["source_type"] == "edge_leader"


def test_the_imu_has_rates_and_accelerations():
    ((suffix, message),) = messages(ImuReport(5.0, Vector3(1, 2, 3), Vector3(0, 0, 9.8)), EDGE)
    assert suffix == "imu"
    assert message == {
        "source_type": "edge",
        "timestamp": 5.0,
        "session_id": "s",
        "sensor_id": "front",
        "gyro": {"x": 1, "y": 2, "z": 3},
        "accel": {"x": 0, "y": 0, "z": 9.8},
    }
