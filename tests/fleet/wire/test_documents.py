import contextlib
import json

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.wire.documents import (
    SHAPES,
    document_in,
    document_out,
    is_for_the_cloud,
    is_state_of_another,
    word_of_update,
)
from fleet.wire.samples import json_payload, json_sample, stamp_of_header
from fleet.wire.topics import data_key

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"

OFFER = {"type": "offer", "target": "backend", "sdp": "v=0", "session_id": "c_front"}
GOOD = {
    "webrtc-offer": OFFER,
    "webrtc-answer": {**OFFER, "type": "answer"},
    "webrtc-candidate": {"type": "candidate", "target": "edge", "candidate": {"candidate": "x"}},
    "event": {"event_type": "fall"},
    "map_update": {"map_type": "point_cloud"},
    "alert": {"name": "low battery"},
    "workflow-run:status": {"status": "running"},
    "environment:update": {"type": "update", "data": {}},
}


def out(suffix, message, session="us"):
    sample = message if isinstance(message, bytes) else json.dumps(message).encode()
    return json.loads(document_out(suffix, sample, source_type="edge", session=session))


def test_every_shape_has_an_example_here():
    assert SHAPES.keys() <= GOOD.keys()


def test_a_signal_keeps_its_own_session_and_gets_no_tag():
    assert out("webrtc-offer", {**OFFER, "ts": 5.0}) == {**OFFER, "timestamp": 5.0}


def test_what_a_program_says_of_a_twin_is_tagged_like_a_report_whatever_it_claims():
    message = out("event", {"event_type": "x", "timestamp": 5.0, "source_type": "tele", "session_id": "me"})
    assert (message["source_type"], message["session_id"], message["timestamp"]) == ("edge", "us", 5.0)
    assert "session_id" not in out("event", {"event_type": "x", "timestamp": 5.0}, session="")


def test_the_header_stamps_what_has_no_stamp_of_its_own():
    sample = json_sample(b'{"event_type": "x"}', stamp=7.5, sequence=1)
    assert out("event", sample)["timestamp"] == 7.5
    with pytest.raises(WireError, match="timestamp: is missing"):
        out("event", b'{"event_type": "x"}')


@pytest.mark.parametrize("suffix", GOOD)
def test_each_good_one_crosses_both_ways(suffix):
    assert out(suffix, {**GOOD[suffix], "ts": 1.0}).items() >= GOOD[suffix].items()
    sample = document_in(suffix, json.dumps(GOOD[suffix]).encode(), size=1000, now=9.0)
    assert json.loads(json_payload(sample)) == GOOD[suffix]
    assert stamp_of_header(sample) == 9.0


EDITS = {
    "position": {"x": 1.0, "y": 2.0, "z": 3.0},
    "rotation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0},
    "scale": {"x": 1.0, "y": 1.0, "z": 2.0},
}


def edit(suffix, message):
    payload = json.dumps(message).encode()
    return json.loads(json_payload(document_in(suffix, payload, size=1000, now=9.0)))


@pytest.mark.parametrize("suffix", EDITS)
def test_what_the_editor_does_with_a_twin_reaches_programs_on_the_bus(suffix):
    message = {"source_type": "edit", suffix: EDITS[suffix], "timestamp": 5.0, "session_id": "front"}
    assert edit(suffix, message) == message


@pytest.mark.parametrize("suffix", EDITS)
@pytest.mark.parametrize(
    "wrong",
    [
        {"source_type": "tele"},
        {"source_type": None},
        {"source_type": "preview"},
        {"given": [1, 2, 3]},
        {"given": {"x": "1"}},
    ],
)
def test_what_is_no_edit_is_refused(suffix, wrong):
    given = {suffix: wrong.get("given", EDITS[suffix])}
    with pytest.raises(WireError):
        edit(suffix, {"source_type": "edit", **wrong, **given})


@pytest.mark.parametrize("suffix", EDITS)
def test_where_others_measured_a_twin_is_no_edit(suffix):
    for source in ("edge", "edge_leader", "edge_follower", "sim"):
        message = json.dumps({"source_type": source, suffix: EDITS[suffix]}).encode()
        assert is_state_of_another(suffix, message)
        assert not is_state_of_another("alert", message)
    assert not is_state_of_another(suffix, json.dumps({"source_type": "edit"}).encode())
    assert not is_state_of_another(suffix, b"garbage")


@pytest.mark.parametrize(
    ("suffix", "field"), [(suffix, field) for suffix in SHAPES for field in SHAPES[suffix].needs]
)
def test_what_lacks_a_field_that_its_readers_need_is_refused_both_ways(suffix, field):
    for message in (
        {name: value for name, value in GOOD[suffix].items() if name != field},
        {**GOOD[suffix], field: 5},
    ):
        with pytest.raises(WireError, match=field):
            out(suffix, {**message, "ts": 1.0})
        with pytest.raises(WireError, match=field):
            document_in(suffix, json.dumps(message).encode(), size=1000, now=9.0)


RAW = {"candidate": "candidate:1 1 udp 2 192.0.2.1 5000 typ host", "sdpMid": "0", "sdpMLineIndex": 0}
"""What a browser gives for a candidate."""


def test_a_browsers_own_candidate_crosses_inward_as_it_is():
    sample = document_in("webrtc-candidate", json.dumps(RAW).encode(), size=1000, now=9.0)
    assert json.loads(json_payload(sample)) == RAW


def test_a_browsers_own_candidate_crosses_outward_and_is_known_when_the_broker_brings_it_back():
    message = out("webrtc-candidate", {**RAW, "ts": 5.0})
    assert message == {**RAW, "timestamp": 5.0, "target": "backend"}
    assert is_for_the_cloud("webrtc-candidate", json.dumps(message).encode())
    assert not is_for_the_cloud("webrtc-candidate", json.dumps(RAW).encode())


@pytest.mark.parametrize("end", [{**RAW, "candidate": ""}, {"candidate": "", "sdpMLineIndex": 0}])
def test_the_end_of_candidates_crosses(end):
    assert out("webrtc-candidate", {**end, "ts": 5.0}).items() >= end.items()


@pytest.mark.parametrize(
    "lame",
    [
        {"candidate": RAW["candidate"]},
        {**RAW, "candidate": None},
        {"sdpMid": "0"},
        {**RAW, "type": "x"},
        {"candidate": "x", "sdpMid": 0, "sdpMLineIndex": "0"},
    ],
)
def test_what_is_no_candidate_crosses_in_neither_direction(lame):
    with pytest.raises(WireError):
        out("webrtc-candidate", {**lame, "ts": 1.0})
    with pytest.raises(WireError):
        document_in("webrtc-candidate", json.dumps(lame).encode(), size=1000, now=9.0)


@pytest.mark.parametrize("update", ["", "a/b", "+", "#", "a b", "9", "x" * 65, "\u00e9", "a\n"])
def test_what_cannot_be_a_level_of_a_topic_is_no_update_of_an_environment(update):
    with pytest.raises(WireError, match="cannot be the type of an update"):
        out(f"environment:{update}", {"ts": 1.0})
    with pytest.raises(WireError, match="cannot be the type of an update"):
        document_in(f"environment:{update}", b"{}", size=1000, now=9.0)


@pytest.mark.parametrize("update", ["update", "twin_added", "twin_removed", "made_up", "telemetry-status"])
def test_an_update_of_an_environment_may_be_of_any_type_and_says_it_both_ways(update):
    suffix = f"environment:{update}"
    assert out(suffix, {"ts": 1.0, "data": {}})["type"] == update
    sample = document_in(suffix, b'{"data": {}}', size=1000, now=9.0)
    assert json.loads(json_payload(sample)) == {"type": update, "data": {}}


@pytest.mark.parametrize(
    ("update", "word"),
    [("twin_removed", "twin_removed"), ("telemetry-status", "telemetry_status"), ("aB", "ab")],
)
def test_the_type_of_an_update_is_a_word_on_the_bus(update, word):
    assert word_of_update(update) == word
    assert data_key(TWIN, "cloud", word)


def test_a_document_from_the_cloud_is_bounded_and_strict():
    for payload in (b'{"a": "' + b"x" * 100 + b'"}', b'{"a": 1, "a": 2}', b'{"a": NaN}', b"\xff", b"[]"):
        with pytest.raises(WireError):
            document_in("commands/sync_workflows", payload, size=50, now=1.0)


@given(st.sampled_from(sorted(GOOD)), st.binary(max_size=80))
@example("environment:update", b'{"":0}')
def test_arbitrary_bytes_raise_nothing_but_a_wire_error(suffix, payload):
    for read in (
        lambda: out(suffix, payload),
        lambda: document_in(suffix, payload, size=1000, now=1.0),
    ):
        with contextlib.suppress(WireError):  # an update of an environment may be any object, such as {"":0}
            read()


def test_no_hostile_bytes_raise_anything_but_a_wire_error(hostile):
    samples = [json.dumps({**message, "ts": 1.0}).encode() for message in GOOD.values()]
    for index, payload in enumerate(hostile(samples)):
        suffix = list(GOOD)[index % len(GOOD)]
        for read in (
            lambda suffix=suffix, payload=payload: out(suffix, payload),
            lambda suffix=suffix, payload=payload: document_in(suffix, payload, size=1000, now=1.0),
        ):
            try:
                read()
            except WireError:
                continue
