import json

import pytest
from cyberwave.data.state_representation.space.joint import parse_joint_mqtt_payload
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.model.command import Transport
from fleet.wire.envelope import BadCommand
from fleet.wire.joints import MOST_JOINTS, decode_joints

FORMS = {
    "targets": {"target_positions": {"a": 1.0}, "target_velocities": {"a": 0.5}},
    "aggregated": {"positions": {"a": 1.0}, "velocities": {"a": 0.5}},
    "single": {"type": "joint_state", "joint_name": "a", "joint_state": {"position": 1.0, "velocity": 0.5}},
}


def decode(**message):
    return decode_joints(json.dumps({"source_type": "tele", **message}).encode(), way=Transport.CLOUD)


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_every_form_is_the_same_command(form):
    command = decode(**form)
    assert command.name == "joint_targets"
    assert command.data == {"positions": {"a": 1.0}, "velocities": {"a": 0.5}}
    assert command.origin.source_type == "tele"


def test_the_flat_form_takes_every_other_number_as_a_joint():
    command = decode(hip=0.5, knee=-1, timestamp=5.0, session_id="s", update_mode="relative")
    assert command.data == {"positions": {"hip": 0.5, "knee": -1.0}, "mode": "relative"}
    assert command.stamp == 5.0


@pytest.mark.parametrize("sender", ["edge", "edge_leader", "edge_follower", "sim"])
def test_what_somebody_measured_asks_nothing_but_a_target_does(sender):
    assert decode(source_type=sender, positions={"a": 1}) is None
    assert decode(source_type=sender, target_positions={"a": 1}).name == "joint_targets"


@pytest.mark.parametrize(
    ("message", "where"),
    [
        ({}, ""),
        ({"positions": {}}, ""),
        ({"positions": {"a": "1"}}, "positions.a"),
        ({"positions": {"a": True}}, "positions.a"),
        ({"positions": [1]}, "positions"),
        ({"target_efforts": {"a": None}}, "target_efforts.a"),
        ({"joint_name": "a"}, "joint_state"),
        ({"joint_name": "a", "joint_state": {}}, ""),
        ({"joint_name": 5, "joint_state": {"position": 1}}, "joint_name"),
        ({"hip": "0.5"}, "hip"),
        ({"positions": {str(n): n for n in range(MOST_JOINTS + 1)}}, "positions"),
        ({"positions": {"a": 1}, "timestamp": "now"}, "timestamp"),
    ],
)
def test_what_is_no_target_is_refused_by_name_with_the_place(message, where):
    with pytest.raises(BadCommand) as refusal:
        decode(**message)
    assert (refusal.value.command, refusal.value.where) == ("joint_targets", where)


@given(st.dictionaries(st.text(min_size=1, max_size=6), st.floats(-10, 10), min_size=1, max_size=4))
def test_targets_are_read_like_the_sdk_does(joints):
    message = {"source_type": "tele", "target_positions": joints}
    assert decode(**message).data["positions"] == parse_joint_mqtt_payload(message).target_positions


def test_no_hostile_bytes_raise_anything_but_a_wire_error(hostile):
    read = 0
    for payload in hostile(json.dumps({"source_type": "tele", **form}).encode() for form in FORMS.values()):
        try:
            read += decode_joints(payload, way=Transport.CLOUD) is not None
        except WireError:
            continue
    assert read > 100
