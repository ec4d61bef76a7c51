import json

import pytest
from cyberwave.data.state_representation.space.joint import parse_joint_mqtt_payload
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.model.command import Transport
from fleet.wire.envelope import BadCommand
from fleet.wire.joints import MOST_JOINTS, decode_joints
from fleet.wire.samples import json_sample

FORMS = {
    "targets": {"target_positions": {"a": 1.0}, "target_velocities": {"a": 0.5}},
    "aggregated": {"positions": {"a": 1.0}, "velocities": {"a": 0.5}},
    "single": {"type": "joint_state", "joint_name": "a", "joint_state": {"position": 1.0, "velocity": 0.5}},
}


def decode(**message):
    return decode_joints(json.dumps({"source_type": "tele", **message}).encode(), transport=Transport.CLOUD)


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_every_form_is_the_same_setpoint(form):
    command = decode(**form)
    assert command.name == "joint_targets"
    assert command.positions == {"a": 1.0}
    assert command.origin.source_type == "tele"


def test_the_flat_form_takes_every_other_number_as_a_joint():
    command = decode(hip=0.5, knee=-1, timestamp=5.0, session_id="s", update_mode="relative")
    assert command.positions == {"hip": 0.5, "knee": -1.0}
    assert command.relative
    assert command.stamp == 5.0


def test_only_relative_targets_have_an_id_by_which_a_repeat_is_recognized():
    assert decode(positions={"a": 1}, update_mode="relative", timestamp=5.0).id
    assert not decode(positions={"a": 1}, update_mode="absolute", timestamp=5.0).id


@pytest.mark.parametrize("sender", ["edge", "edge_follower", "sim"])
def test_what_somebody_measured_asks_nothing_but_a_target_does(sender):
    assert decode(source_type=sender, positions={"a": 1}) is None
    assert decode(source_type=sender, target_positions={"a": 1}).name == "joint_targets"


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_what_a_leader_measured_leads_a_follower_but_is_the_leaders_own_state(form):
    payload = json.dumps({"source_type": "edge_leader", **form}).encode()
    assert decode_joints(payload, transport=Transport.CLOUD).positions == {"a": 1.0}
    if "target_positions" not in form:
        assert decode_joints(payload, transport=Transport.CLOUD, leads=True) is None


def test_the_bus_has_arrays_and_a_header_whose_stamp_counts():
    sample = json_sample(b'{"names": ["a", "b"], "positions": [1, 2]}', stamp=7.0, sequence=1)
    setpoint = decode_joints(sample, transport=Transport.BUS)
    assert (setpoint.positions, setpoint.stamp) == ({"a": 1.0, "b": 2.0}, 7.0)


@pytest.mark.parametrize(
    "message",
    [
        {"names": ["a"], "positions": [1, 2]},
        {"names": ["a", "a"], "positions": [1, 2]},
        {"names": [1], "positions": [1]},
        {"names": ["a"], "positions": {"a": 1}},
        {"names": ["a"], "positions": [None]},
        {"names": [], "positions": []},
    ],
)
def test_arrays_that_do_not_belong_together_are_refused(message):
    with pytest.raises(BadCommand):
        decode_joints(json.dumps(message).encode(), transport=Transport.BUS)


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
        ({"target_velocities": {"a": 1}}, "velocities.a"),
        ({"target_positions": {"a": 1}, "target_efforts": {"b": 1}}, "efforts.b"),
        ({"positions": {"a": 1}, "update_mode": "additive"}, "update_mode"),
        ({"positions": {"a": 1}, "mode": 5}, "mode"),
    ],
)
def test_what_is_no_target_is_refused_by_name_with_the_place(message, where):
    with pytest.raises(BadCommand) as refusal:
        decode(**message)
    assert (refusal.value.command, refusal.value.where) == ("joint_targets", where)


@given(st.dictionaries(st.text(min_size=1, max_size=6), st.floats(-10, 10), min_size=1, max_size=4))
def test_targets_are_read_like_the_sdk_does(joints):
    message = {"source_type": "tele", "target_positions": joints}
    assert decode(**message).positions == parse_joint_mqtt_payload(message).target_positions


def test_no_hostile_bytes_raise_anything_but_a_wire_error(hostile):
    read = 0
    for payload in hostile(json.dumps({"source_type": "tele", **form}).encode() for form in FORMS.values()):
        try:
            read += decode_joints(payload, transport=Transport.CLOUD) is not None
        except WireError:
            continue
    assert read > 100
