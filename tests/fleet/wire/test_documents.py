import contextlib
import json

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.wire.documents import SHAPES, UPDATE_TYPES, document_in, document_out, is_for_the_cloud
from fleet.wire.samples import json_payload, json_sample, stamp_of_header

OFFER = {"type": "offer", "target": "backend", "sdp": "v=0", "session_id": "c_front"}
GOOD = {
    "webrtc-offer": OFFER,
    "webrtc-answer": {**OFFER, "type": "answer"},
    "webrtc-candidate": {"type": "candidate", "target": "edge", "candidate": {"candidate": "x"}},
    "event": {"event_type": "fall"},
    "map_update": {"map_type": "point_cloud"},
    "alert": {"name": "low battery"},
    "workflow-run:status": {"status": "running"},
    "environment:update": {"data": {}},
}


def out(leaf, message, session="us"):
    sample = message if isinstance(message, bytes) else json.dumps(message).encode()
    return json.loads(document_out(leaf, sample, source_type="edge", session=session))


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


@pytest.mark.parametrize("leaf", GOOD)
def test_each_good_one_crosses_both_ways(leaf):
    assert out(leaf, {**GOOD[leaf], "ts": 1.0}).items() >= GOOD[leaf].items()
    sample = document_in(leaf, json.dumps(GOOD[leaf]).encode(), size=1000, now=9.0)
    assert json.loads(json_payload(sample)) == GOOD[leaf]
    assert stamp_of_header(sample) == 9.0


@pytest.mark.parametrize(
    ("leaf", "field"), [(leaf, field) for leaf in SHAPES for field in SHAPES[leaf].needs]
)
def test_what_lacks_a_field_that_its_readers_need_is_refused_both_ways(leaf, field):
    for message in (
        {name: value for name, value in GOOD[leaf].items() if name != field},
        {**GOOD[leaf], field: 5},
    ):
        with pytest.raises(WireError, match=field):
            out(leaf, {**message, "ts": 1.0})
        with pytest.raises(WireError, match=field):
            document_in(leaf, json.dumps(message).encode(), size=1000, now=9.0)


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


@pytest.mark.parametrize("update", ["", "made_up", "telemetry-status", "a/b"])
def test_an_unknown_update_of_an_environment_is_refused(update):
    with pytest.raises(WireError, match="is not an update of an environment"):
        out(f"environment:{update}", {"ts": 1.0})


@pytest.mark.parametrize("update", sorted(UPDATE_TYPES))
def test_an_update_of_an_environment_says_its_type(update):
    assert out(f"environment:{update}", {"ts": 1.0, "data": {}})["type"] == update


def test_a_document_from_the_cloud_is_bounded_and_strict():
    for payload in (b'{"a": "' + b"x" * 100 + b'"}', b'{"a": 1, "a": 2}', b'{"a": NaN}', b"\xff", b"[]"):
        with pytest.raises(WireError):
            document_in("commands/sync_workflows", payload, size=50, now=1.0)


@given(st.sampled_from(sorted(GOOD)), st.binary(max_size=80))
@example("environment:update", b'{"":0}')
def test_arbitrary_bytes_raise_nothing_but_a_wire_error(leaf, payload):
    for read in (
        lambda: out(leaf, payload),
        lambda: document_in(leaf, payload, size=1000, now=1.0),
    ):
        with contextlib.suppress(WireError):  # an update of an environment may be any object, such as {"":0}
            read()


def test_no_hostile_bytes_raise_anything_but_a_wire_error(hostile):
    samples = [json.dumps({**message, "ts": 1.0}).encode() for message in GOOD.values()]
    for index, payload in enumerate(hostile(samples)):
        leaf = list(GOOD)[index % len(GOOD)]
        for read in (
            lambda leaf=leaf, payload=payload: out(leaf, payload),
            lambda leaf=leaf, payload=payload: document_in(leaf, payload, size=1000, now=1.0),
        ):
            try:
                read()
            except WireError:
                continue
