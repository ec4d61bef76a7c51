import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.wire.edge_heartbeat import EdgeHeartbeat, read_heartbeat
from fleet.wire.health import edge_health

BEATS = st.builds(EdgeHeartbeat, st.sampled_from("abc"), st.sampled_from("xyz"), st.floats(0, 1e9))


def test_our_own_heartbeat_is_read():
    payload = edge_health(
        twin="t", edge_id="yard-1", uptime=12.3, stamp=5.0, source_type="edge", session="s", extra={}
    )
    assert read_heartbeat(payload) == EdgeHeartbeat("yard-1", "s", 12.3)


@given(BEATS, BEATS)
def test_of_two_edges_both_say_the_same_one_was_first(one, other):
    assert one.is_older_than(other) != other.is_older_than(one) or (one.edge, one.session) == (
        other.edge,
        other.session,
    )


def test_who_runs_longer_was_first():
    assert EdgeHeartbeat("b", "", 100.0).is_older_than(EdgeHeartbeat("a", "", 50.0))
    assert EdgeHeartbeat("a", "", 50.4).is_older_than(EdgeHeartbeat("b", "", 50.9))


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"{}",
        b'{"type": "edge_health"}',
        b'{"type": "edge_health", "edge_id": 5}',
        b'{"type": "edge_health", "edge_id": ""}',
        b'{"type": "edge_health", "edge_id": "a", "uptime_seconds": "5"}',
        b'{"type": "edge_health", "edge_id": "a", "uptime_seconds": NaN}',
        b'{"type": "edge_health", "edge_id": "a", "session_id": 5}',
    ],
)
def test_what_is_no_heartbeat_is_refused(payload):
    with pytest.raises(WireError):
        read_heartbeat(payload)
