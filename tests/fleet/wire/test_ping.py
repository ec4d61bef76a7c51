import json

import pytest

from fleet.errors import WireError
from fleet.wire.ping import check_ping, is_clouds_pong, ping, pong

BAD = [
    b"",
    b"[]",
    b"\xff",
    b'{"type": 5}',
    b'{"type": "offer"}',
    b'{"a": NaN}',
    b"{" * 100,
    b'"' + b"x" * 5000 + b'"',
]


def test_a_ping_is_the_sdks():
    message = json.loads(ping(stamp=5.0, session="us"))
    assert (message["type"], message["timestamp"]) == ("ping", 5.0)
    check_ping(ping(stamp=5.0, session="us"))


def test_an_edges_pong_is_not_the_clouds():
    assert not is_clouds_pong(pong(stamp=5.0, edge_id="yard-1", source_type="edge", session="us"))
    assert is_clouds_pong(b'{"type": "pong", "timestamp": 5.0}')
    assert is_clouds_pong(b'{"timestamp": 5.0}')


@pytest.mark.parametrize("payload", BAD)
def test_what_is_neither_is_refused(payload):
    with pytest.raises(WireError):
        check_ping(payload)
    with pytest.raises(WireError):
        is_clouds_pong(payload)
