import pytest

from fleet.bridge.round_trip import LATE_AFTER, LOST_AFTER, PING_EVERY, RoundTrip
from fleet.errors import WireError

PONG = b'{"type": "pong"}'


@pytest.fixture
def trip(clock):
    trip = RoundTrip(lambda: trip.sent.append(clock.monotonic()), clock)
    trip.sent = []
    return trip


def test_a_pong_gives_the_time_since_its_ping(trip, clock):
    trip.request()
    clock.advance(0.12)
    trip.handle_pong(PONG)
    assert trip.seconds == pytest.approx(0.12)
    clock.advance(5.0)
    trip.handle_pong(PONG)
    assert trip.seconds == pytest.approx(0.12), "nobody asked"


def test_one_ping_is_under_way_at_a_time_and_a_lost_one_is_forgotten(trip, clock):
    trip.request()
    clock.advance(0.1)
    trip.handle_pong(PONG)
    clock.advance(PING_EVERY)
    for _ in range(4):
        trip.request()
        clock.advance(LOST_AFTER / 2)
    assert len(trip.sent) == 3
    assert trip.seconds is None


def test_a_late_pong_counts_for_its_own_ping_and_not_for_a_newer_one(trip, clock):
    trip.request()
    clock.advance(0.1)
    trip.handle_pong(PONG)
    clock.advance(PING_EVERY)
    trip.request()
    for _ in range(4):
        clock.advance(LATE_AFTER / 3)
        trip.request()
    assert trip.seconds is None
    trip.handle_pong(PONG)
    assert trip.seconds == pytest.approx(4 * LATE_AFTER / 3)


def test_a_ping_is_sent_now_and_then_however_often_it_is_time_to_look(trip, clock):
    for _ in range(5):
        trip.request()
        trip.handle_pong(PONG)
        clock.advance(PING_EVERY / 2)
    assert len(trip.sent) == 3


def test_another_edge_does_not_answer_for_the_cloud(trip, clock):
    trip.request()
    trip.handle_pong(b'{"type": "pong", "edge_id": "yard-2"}')
    assert trip.seconds is None
    with pytest.raises(WireError):
        trip.handle_pong(b"garbage")
