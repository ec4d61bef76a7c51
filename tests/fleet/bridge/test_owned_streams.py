import json
import logging

import pytest

from fleet.bridge.owned_streams import MOST, OwnedStreams
from fleet.runtime.rate_limited_counter import RateLimitedCounter
from fleet.wire.streams import LIFETIME

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
STRANGER = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c99"
CONNECTED = json.dumps({"connection_state": "connected"}).encode()


def key(sensor, twin=TWIN):
    return f"cw/{twin}/data/streams/{sensor}"


@pytest.fixture
def refusals(clock):
    return RateLimitedCounter(logging.getLogger("fleet.bridge"), clock)


@pytest.fixture
def streams(ports, refusals, clock):
    return OwnedStreams(ports, refusals, clock)


def test_a_stream_is_there_while_it_is_reported(streams, clock):
    streams.handle_report(key("front"), CONNECTED)
    clock.advance(LIFETIME - 0.1)
    streams.handle_report(key("front"), CONNECTED)
    clock.advance(LIFETIME - 0.1)
    assert list(streams.of(TWIN)) == ["front"]
    clock.advance(0.2)  # its program was killed, or hangs
    assert streams.of(TWIN) == {}


def test_a_stream_that_says_that_it_ended_is_gone_at_once(streams):
    streams.handle_report(key("front"), CONNECTED)
    streams.handle_report(key("rear"), CONNECTED)
    streams.handle_report(key("front"), b"")
    assert list(streams.of(TWIN)) == ["rear"]


def test_what_cannot_be_read_is_counted_and_changes_nothing(streams, refusals):
    streams.handle_report(key("front"), CONNECTED)
    streams.handle_report(key("front"), b'{"connection_state": "splendid"}')
    assert list(streams.of(TWIN)) == ["front"]
    assert refusals.counts() == {"unreadable": 1}


def test_other_twins_and_other_keys_are_left_alone(streams, refusals):
    streams.handle_report(key("front", STRANGER), b"x")
    streams.handle_report(f"cw/{TWIN}/data/streams", CONNECTED)
    assert (streams.of(TWIN), refusals.counts()) == ({}, {})


def test_a_twin_has_no_more_streams_than_fit_its_heartbeat(streams, refusals):
    for number in range(MOST + 1):
        streams.handle_report(key(f"camera_{number}"), CONNECTED)
    streams.handle_report(key("camera_0"), CONNECTED)  # those that are known may go on
    assert (len(streams.of(TWIN)), refusals.counts()) == (MOST, {"too many": 1})


def test_the_subscription_finds_every_stream(streams):
    keys = []
    streams.listen(lambda pattern, call: keys.append((pattern, call)))
    assert keys == [("cw/*/data/streams/*", streams.handle_report)]
