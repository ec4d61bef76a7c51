import json

import pytest

from fleet.errors import WireError
from fleet.video.signals import IceCandidate, VideoStream, answer_for, candidate_in, offer_message
from fleet.wire.documents import document_in, document_out

SDP = "v=0\r\nm=video 9 UDP/TLS/RTP/SAVPF 97\r\n"
ANSWER = {"target": "edge", "type": "answer", "sdp": SDP}
LINE = "1 1 udp 2 192.0.2.1 5000 typ host"
RAW = {"candidate": f"candidate:{LINE}", "sdpMid": "0", "sdpMLineIndex": 0}


def carried(suffix, message):
    """Return a message as the bridge puts it on the bus."""
    return document_in(suffix, json.dumps(message).encode(), size=10_000, now=1.0)


def test_an_offer_has_what_the_media_service_reads_and_crosses():
    stream = VideoStream("front", "track-1", "video_rex_7_front")
    offer = offer_message(SDP, stream, recording=False, attributes={"width": 320}, stamp=5.0)
    assert (
        offer.items() >= {"target": "backend", "sender": "edge", "type": "offer", "recording": False}.items()
    )
    assert (offer["sensor"], offer["track_id"], offer["session_id"]) == ("front", "track-1", stream.session)
    crossed = document_out("webrtc-offer", json.dumps(offer).encode(), source_type="edge", session="us")
    assert json.loads(crossed) == offer


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"sensor": "front"},
        {"camera": "front"},
        {"stream_source": "live", "stream_instance_id": "default"},
    ],
)
def test_an_answer_to_our_offer_is_taken(more):
    assert answer_for(carried("webrtc-answer", ANSWER | more), "front") == SDP


@pytest.mark.parametrize(
    "more",
    [
        {"sensor": "rear"},
        {"camera": "rear"},
        {"target": "backend"},
        {"sdp": "v=0\r\nm=audio 9 UDP/TLS/RTP/SAVPF 96\r\n"},
        {"stream_source": "replay"},
        {"stream_instance_id": "second"},
    ],
)
def test_an_answer_for_another_is_left_alone(more):
    assert answer_for(json.dumps(ANSWER | more).encode(), "front") is None


@pytest.mark.parametrize(
    "message",
    [
        RAW,
        {"type": "candidate", "target": "edge", "candidate": RAW},
        {"type": "candidate", "target": "edge", **RAW},
        {**RAW, "candidate": f"a=candidate:{LINE}"},
    ],
)
def test_a_candidate_is_read_in_each_published_form(message):
    assert candidate_in(carried("webrtc-candidate", message)) == IceCandidate(LINE, "0", 0)


def test_the_end_of_candidates_needs_no_place():
    assert candidate_in(b'{"candidate": ""}') == IceCandidate("")


@pytest.mark.parametrize(
    "sample", [b"", b"{}", b'{"candidate": 5}', b'{"candidate": "x"}', b'{"candidate": {}}']
)
def test_what_is_no_candidate_is_refused(sample):
    with pytest.raises(WireError):
        candidate_in(sample)


@pytest.mark.parametrize("sample", [b"", b"[]", b"{}", b'{"sdp": 1}'])
def test_what_is_no_answer_is_refused(sample):
    with pytest.raises(WireError):
        answer_for(sample, "front")
