"""Who asks for what, and when: the envelope of every request."""

import json

import pytest
from cyberwave.data.header import HeaderTemplate
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.model.command import Command, Origin, Transport
from fleet.wire.envelope import (
    LONGEST_NAME,
    BadCommand,
    digest,
    identity,
    name_of,
    optional_word,
    origin_and_stamp,
    sampled_object,
    seconds_of,
    stamp_of,
    stop_requested,
    tolerant,
)

CLOUD, BUS = Transport.CLOUD, Transport.BUS
TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
OTHER = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c12"


def refused(read, *arguments, **more):
    with pytest.raises(WireError) as refusal:
        read(*arguments, **more)
    return str(refusal.value)


# -- names --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("message", "name"),
    [
        ({"command": "land"}, "land"),
        ({"type": "start_video"}, "start_video"),
        ({"type": "status", "command": "land"}, "land"),
        ({"type": "land", "command": None}, "land"),
        ({"command": "x"}, "x"),
        ({"command": "Arm.left-2_b"}, "Arm.left-2_b"),
        ({"command": "a" * LONGEST_NAME}, "a" * LONGEST_NAME),
        ({"command": "E-Stop"}, "emergency_stop"),
        ({"command": "land", "type": "STOP"}, "stop"),
    ],
)
def test_a_request_is_named_by_its_command_or_its_type_and_a_stop_goes_first(message, name):
    assert name_of(message) == name


@pytest.mark.parametrize(
    ("message", "refusal"),
    [
        ({}, "command: is missing"),
        ({"command": None, "type": None}, "command: is missing"),
        ({"command": ""}, "command: '' is not the name of a command"),
        ({"command": "2up"}, "command: '2up' is not the name of a command"),
        ({"command": "go home"}, "command: 'go home' is not the name of a command"),
        ({"command": "land\n"}, "command: 'land\\n' is not the name of a command"),
        ({"command": "l\u00e4nd"}, "command: 'l\\xe4nd' is not the name of a command"),
        ({"command": 7}, "command: '7' is not the name of a command"),
        ({"type": []}, "type: '[]' is not the name of a command"),
        ({"command": "a" * (LONGEST_NAME + 1)}, f"command: '{'a' * 40}' is not the name of a command"),
    ],
)
def test_what_is_no_name_is_refused_shortened_and_in_ascii(message, refusal):
    assert refused(name_of, message) == refusal


# -- identities ---------------------------------------------------------------------------------------


def test_a_digest_is_32_hexadecimal_digits_of_the_content():
    assert digest(b"") == "cae66941d9efbd404e4d88758ea67670"
    assert len(digest(b"x" * 10**5)) == 32


def test_a_request_with_an_id_is_known_by_the_id_and_what_it_asks():
    first = identity(b"a", 1.0, "r1", ["land", {}])
    assert identity(b"another spelling", None, "r1", ["land", {}]) == first
    assert identity(b"a", 1.0, "r2", ["land", {}]) != first
    assert identity(b"a", 1.0, "r1", ["takeoff", {}]) != first


def test_a_request_without_an_id_is_known_by_all_of_its_bytes_if_it_has_a_stamp():
    first = identity(b"a", 1.0, "", "land")
    assert identity(b"a", 9.0, "", "takeoff") == first == digest(b"a")
    assert identity(b"b", 1.0, "", "land") != first
    assert identity(b"a", 0.0, "", "land") == first
    assert identity(b"a", None, "", "land") == ""


# -- stamps -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("message", "stamp"),
    [
        ({"timestamp": 1760000000.25}, 1760000000.25),
        ({"ts": 5}, 5.0),
        ({"timestamp": 5, "ts": 6}, 5.0),
        ({"timestamp": None, "ts": 6}, 6.0),
        ({"timestamp": 1760000000250}, 1760000000.25),
        ({"timestamp": 0}, 0.0),
        ({"timestamp": -1}, -1.0),
        ({"timestamp": None}, None),
        ({}, None),
    ],
)
def test_a_stamp_is_unix_seconds_from_either_field(message, stamp):
    assert stamp_of(message) == stamp


def test_stamps_beyond_the_year_5138_are_milliseconds():
    assert (seconds_of(1e11), seconds_of(1e11 + 1)) == (1e11, 100000000.001)


@pytest.mark.parametrize("field", ["timestamp", "ts"])
@pytest.mark.parametrize("value", ["5", True, [], float("nan")])
def test_a_stamp_that_is_no_number_is_refused_with_its_field(field, value):
    assert refused(stamp_of, {field: value}).startswith(f"{field}: ")


def sample(message, stamp):
    return HeaderTemplate("application/json").pack(json.dumps(message).encode(), ts=stamp)


@pytest.mark.parametrize(
    ("message", "header", "stamp"),
    [
        ({}, 7.0, 7.0),
        ({"timestamp": None}, 7.0, 7.0),
        ({"timestamp": 5.0}, 7.0, 5.0),
        ({"ts": 5.0}, 7.0, 5.0),
        ({}, 0.0, None),
    ],
)
def test_a_message_of_the_bus_is_as_old_as_it_says_else_as_its_header_says(message, header, stamp):
    assert stamp_of(sampled_object(sample(message, header))) == stamp


def test_a_message_of_the_bus_without_a_header_has_only_its_own_stamp():
    assert sampled_object(b'{"command": "land"}') == {"command": "land"}
    assert refused(sampled_object, b"[]") == "neither a Cyberwave sample nor a JSON object"
    assert refused(sampled_object, sample([], 1.0)) == "a JSON object is needed, this is an array"


# -- senders ------------------------------------------------------------------------------------------


def test_the_sender_and_the_stamp_are_read():
    message = {"source_type": "tele", "session_id": "s", "timestamp": 5, "twin_uuid": TWIN}
    assert origin_and_stamp(message, CLOUD, strict=True, twin=TWIN) == (Origin(CLOUD, "tele", "s"), 5.0)
    assert origin_and_stamp({}, BUS, strict=True) == (Origin(BUS, None, ""), None)
    assert origin_and_stamp({"source_type": None, "session_id": None}, BUS, strict=True) == (
        Origin(BUS, None, ""),
        None,
    )


@pytest.mark.parametrize(
    ("flaw", "sender", "stamp"),
    [
        ({"source_type": 7}, Origin(CLOUD, None, "s"), 5.0),
        ({"session_id": []}, Origin(CLOUD, "tele", ""), 5.0),
        ({"timestamp": "now"}, Origin(CLOUD, "tele", "s"), None),
        ({"twin_uuid": OTHER}, Origin(CLOUD, "tele", "s"), 5.0),
        ({"twin_uuid": 7}, Origin(CLOUD, "tele", "s"), 5.0),
    ],
)
def test_a_flaw_is_refused_but_for_a_stop_it_counts_as_not_given(flaw, sender, stamp):
    message = {"source_type": "tele", "session_id": "s", "timestamp": 5, **flaw}
    assert refused(origin_and_stamp, message, CLOUD, strict=True, twin=TWIN).startswith(
        f"{next(iter(flaw))}: "
    )
    assert origin_and_stamp(message, CLOUD, strict=False, twin=TWIN) == (sender, stamp)


@pytest.mark.parametrize("named", [TWIN, TWIN.upper(), TWIN.replace("-", ""), f"{{{TWIN}}}", "", None])
def test_a_twin_may_be_named_in_any_spelling(named):
    assert origin_and_stamp({"twin_uuid": named}, CLOUD, strict=True, twin=TWIN)[1] is None


@pytest.mark.parametrize("named", [OTHER, "rex", TWIN[:-1]])
def test_a_message_for_another_twin_is_refused_with_both(named):
    error = refused(origin_and_stamp, {"twin_uuid": named}, CLOUD, strict=True, twin=TWIN)
    assert error == f"twin_uuid: {named!r} is not this twin, which is {TWIN}"


def test_any_twin_may_be_named_where_the_reader_is_of_none():
    origin_and_stamp({"twin_uuid": "rex"}, CLOUD, strict=True)


# -- stops --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("message", "name"),
    [({"command": "stop"}, "stop"), ({"type": "E-Stop"}, "emergency_stop"), ({"command": "hover"}, "hover")],
)
def test_a_stop_on_a_topic_of_goals_is_a_command_whatever_else_is_wrong_with_it(message, name):
    found = stop_requested({**message, "source_type": 7, "session_id": "s", "timestamp": "now"}, CLOUD)
    assert found == Command(name, origin=Origin(CLOUD, None, "s"), stamp=None)


def test_a_stop_keeps_its_stamp():
    assert stop_requested({"command": "stop", "timestamp": 5}, BUS).stamp == 5.0


@pytest.mark.parametrize(
    "message", [{}, {"command": "goto"}, {"data": "stop"}, {"command": "estop", "data": {"activate": False}}]
)
def test_what_names_no_stop_is_none(message):
    assert stop_requested(message, CLOUD) is None


# -- helpers ------------------------------------------------------------------------------------------


@given(st.none() | st.booleans() | st.integers() | st.text() | st.lists(st.none()))
def test_a_word_is_a_string_or_missing(value):
    if value is None or isinstance(value, str):
        assert optional_word({"a": value}, "a") == value
    else:
        assert refused(optional_word, {"a": value}, "a").startswith("a: a string is needed, this is ")
        assert tolerant(optional_word, {"a": value}, "a", strict=False) is None
        refused(tolerant, optional_word, {"a": value}, "a", strict=True)


def test_a_refusal_names_the_request_and_the_place_once():
    error = BadCommand(WireError("is missing", where="data.x"), command="move", action_id="a-1")
    assert (str(error), error.where, error.command, error.action_id) == (
        "data.x: is missing",
        "data.x",
        "move",
        "a-1",
    )
    bare = BadCommand(WireError("not JSON"))
    assert (str(bare), bare.where, bare.command, bare.action_id) == ("not JSON", "", "", "")
