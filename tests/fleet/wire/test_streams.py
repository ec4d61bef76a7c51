import json

import pytest

from fleet.errors import WireError
from fleet.wire.samples import json_sample
from fleet.wire.streams import LARGEST, STALE, StreamState, health_of, read_stream

CONNECTED = StreamState("connected", "completed", "front", 12, 100.0, 9.876, 4.56, 1, {"kind": "camera"})


def test_an_entry_has_the_sdks_fields_in_its_order():
    assert list(health_of("front", CONNECTED, now=101.0).items()) == [
        ("camera_id", "front"),
        ("connection_state", "connected"),
        ("ice_connection_state", "completed"),
        ("frames_sent", 12),
        ("last_frame_ts", 100.0),
        ("fps", 9.88),
        ("uptime_seconds", 4.6),
        ("restart_count", 1),
        ("is_stale", False),
        ("is_healthy", True),
        ("stream_config", {"kind": "camera"}),
    ]


def test_a_stream_is_named_by_its_key_where_it_says_nothing():
    entry = health_of("front", StreamState("connecting"), now=1.0)
    assert (entry["camera_id"], "stream_config" in entry) == ("front", False)


@pytest.mark.parametrize(
    ("stream", "stale", "healthy"),
    [
        (CONNECTED, False, True),
        (StreamState("connected", last_frame_ts=101.0 - STALE - 0.1), True, False),
        (StreamState("connected", uptime_seconds=STALE + 0.1), True, False),
        (StreamState("connected", uptime_seconds=1.0), False, True),
        (StreamState("connecting", last_frame_ts=100.0), False, False),
        (StreamState("disconnected", last_frame_ts=100.0), False, False),
    ],
)
def test_a_stream_is_stale_after_a_minute_without_a_frame_and_healthy_while_connected_and_not(
    stream, stale, healthy
):
    entry = health_of("front", stream, now=101.0)
    assert (entry["is_stale"], entry["is_healthy"]) == (stale, healthy)


def test_a_stream_is_read_with_and_without_the_header_and_empty_when_it_has_ended():
    payload = json.dumps({"connection_state": "connected", "frames_sent": 3, "more": 1}).encode()
    assert read_stream(payload) == StreamState("connected", frames_sent=3)
    assert read_stream(json_sample(payload, stamp=1.0, sequence=0)) == StreamState("connected", frames_sent=3)
    assert read_stream(b"") is None


@pytest.mark.parametrize(
    "sample",
    [
        b"x",
        b"{}",
        b'{"connection_state": "well"}',
        b'{"connection_state": "connected", "frames_sent": -1}',
        b'{"connection_state": "connected", "fps": NaN}',
        b'{"connection_state": "connected", "last_frame_ts": "now"}',
        b'{"connection_state": "connected", "camera_id": "' + b"x" * LARGEST + b'"}',
    ],
)
def test_what_is_no_stream_is_refused(sample):
    with pytest.raises(WireError):
        read_stream(sample)
