import json

import pytest
from cyberwave.mqtt.command_response import CommandOutcome, build_command_response, is_command_response
from cyberwave_contracts import MODELS_BY_CONTRACT_ID
from hypothesis import given
from hypothesis import strategies as st

from fleet.model.command import Reply, ReplyStatus, Transport
from fleet.wire.commands import MotionDefaults, decode_command
from fleet.wire.replies import command_response, legacy_status

WORDS = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
REPLIES = st.builds(
    Reply,
    WORDS,
    st.sampled_from(ReplyStatus),
    WORDS,
    WORDS,
    st.none() | WORDS,
    st.lists(WORDS, max_size=3).map(tuple),
    st.none() | st.booleans(),
)


def response(reply, twin="t"):
    return json.loads(command_response(reply, twin=twin, source_type="edge", stamp=5.0))


def status(reply):
    return json.loads(legacy_status(reply, stamp=5.0, source_type="sim"))


@given(REPLIES)
def test_every_reply_keeps_the_contract(reply):
    message = response(reply)
    MODELS_BY_CONTRACT_ID["twin.command_response.v1"].model_validate(message)
    assert is_command_response(message)


@pytest.mark.parametrize(
    ("says", "expected"),
    [("edge", "edge"), ("edge_leader", "edge"), ("edge_follower", "edge"), ("sim", "sim")],
)
def test_a_reply_says_no_more_than_edge_or_sim_whatever_its_robot_s_state_says(says, expected):
    reply = Reply("land", ReplyStatus.ACCEPTED)
    message = json.loads(command_response(reply, twin="t", source_type=says, stamp=5.0))
    MODELS_BY_CONTRACT_ID["twin.command_response.v1"].model_validate(message)
    assert message["source_type"] == expected


@pytest.mark.parametrize("word", ReplyStatus)
def test_a_reply_is_what_the_sdk_would_have_built(word, twin):
    reply = Reply("takeoff", word, "no GPS", "", "MAV_RESULT_DENIED", ("Need 3D Fix",))
    outcome = CommandOutcome(word.value, "no GPS", "MAV_RESULT_DENIED", ("Need 3D Fix",))
    expected = build_command_response(outcome, twin_uuid=twin, command="takeoff", timestamp=5.0)
    assert response(reply, twin) == expected


def test_what_is_empty_is_left_out():
    assert response(Reply("land", ReplyStatus.ACCEPTED)) == {
        "contract": "twin.command_response.v1",
        "twin_uuid": "t",
        "command": "land",
        "status": "accepted",
        "source_type": "edge",
        "timestamp": 5.0,
    }


def test_the_hint_is_part_of_the_reason_that_a_person_reads():
    reply = Reply("takeoff", ReplyStatus.DENIED, "not armable", "wait for GPS")
    assert response(reply)["reason"] == "not armable (wait for GPS)"


def test_the_outcome_stands_beside_the_contract_once_it_is_known():
    assert response(Reply("land", ReplyStatus.ACCEPTED, done=True))["done"] is True


@pytest.mark.parametrize(
    ("word", "expected"),
    [("accepted", "ok"), ("rejected", "error"), ("denied", "error"), ("timeout", "error")],
)
def test_a_legacy_status_says_ok_or_error(word, expected):
    message = status(Reply("takeoff", ReplyStatus(word), "why"))
    assert (message["status"], message["ok"]) == (expected, expected == "ok")
    assert (message["command"], message["reason"], message["source_type"]) == ("takeoff", "why", "sim")


@given(REPLIES)
def test_our_own_status_is_never_taken_for_a_command(reply):
    payload = legacy_status(reply, stamp=5.0, source_type="edge")
    assert (
        decode_command(payload, transport=Transport.CLOUD, defaults=lambda _: MotionDefaults(1, 1, 1, 1))
        is None
    )
    payload = command_response(reply, twin="t", source_type="edge", stamp=5.0)
    assert (
        decode_command(payload, transport=Transport.CLOUD, defaults=lambda _: MotionDefaults(1, 1, 1, 1))
        is None
    )


def test_what_was_asked_for_is_brought_to_who_asked():
    checks = [{"check": "home", "ok": None, "words": []}]
    reply = Reply(
        "check_ready",
        ReplyStatus.ACCEPTED,
        done=True,
        data={"ready": False, "checks": checks, "x": float("nan")},
    )
    for message in (response(reply), status(reply)):
        assert message["data"] == {"ready": False, "checks": checks, "x": None}
    assert is_command_response(response(reply))
    MODELS_BY_CONTRACT_ID["twin.command_response.v1"].model_validate(response(reply))


@pytest.mark.parametrize("data", [0, False, "", [], {}])
def test_a_result_that_is_empty_is_a_result(data):
    assert response(Reply("list_logs", ReplyStatus.ACCEPTED, done=True, data=data))["data"] == data


def test_without_a_result_nothing_stands_for_it():
    assert "data" not in response(Reply("land", ReplyStatus.ACCEPTED, done=True))


def test_what_was_asked_for_stands_in_both_forms_of_the_answer():
    reply = Reply("set_linear_velocity", ReplyStatus.ACCEPTED, data={"linear": 0.8})
    response = json.loads(command_response(reply, twin="t", source_type="edge", stamp=1.0))
    assert response["data"] == {"linear": 0.8}
    assert json.loads(legacy_status(reply, stamp=1.0, source_type="edge"))["data"] == {"linear": 0.8}
