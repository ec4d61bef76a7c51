"""What waits for one client: bounded, in order, within its window, and sent again after a reconnection."""

import mqtt5
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.sim.broker.limits import ClientLimits
from fleet.sim.broker.session import BrokerSession, QueuedCopy

ONCE = [mqtt5.PubRecReasonCode.SUCCESS, mqtt5.PubRecReasonCode(0x10)]


def copy(payload=b"x", qos=1, deadline=None, **fields):
    packet = mqtt5.PublishPacket("a", payload, qos=mqtt5.QoS(qos), packet_id=7 if qos else None, **fields)
    return QueuedCopy(packet, qos, retain=False, identifiers=[], deadline=deadline)


@pytest.fixture
def session():
    return BrokerSession("ann", ClientLimits(queue=3, queue_bytes=10))


def payloads(packets):
    return [packet.payload for packet in packets]


def sent(session, now=0.0):
    return [(packet.payload, packet.packet_id) for packet in session.send(now)]


@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 2)), max_size=12), st.integers(1, 4))
def test_what_waits_is_bounded_and_room_comes_back_when_it_is_sent(offered, window):
    session = BrokerSession("ann", ClientLimits(queue=3, queue_bytes=10))
    session.window = window
    for size, qos in offered:
        waiting = [*session._held, *session._queue]
        fits = len(waiting) < 3 and sum(len(one.packet.payload) for one in waiting) + size <= 10
        assert session.offer(copy(bytes(size), qos)) is fits
        if not fits:
            for packet in session.send(0.0):
                session.forget(packet.packet_id)


def test_a_message_without_room_drops_the_oldest_for_a_client_that_is_away(session):
    for payload in (b"1", b"2", b"3", b"4"):
        session.offer_dropping_oldest(copy(payload))
    assert payloads(session.send(0.0)) == [b"2", b"3", b"4"]


def test_a_large_message_drops_as_many_as_it_needs_and_one_that_never_fits_all(session):
    for payload in (b"1", b"2", bytes(9)):
        session.offer_dropping_oldest(copy(payload))
    assert payloads(session.send(0.0)) == [b"2", bytes(9)]
    session.offer_dropping_oldest(copy(b"1"))
    session.offer_dropping_oldest(copy(bytes(11)))
    assert session.send(0.0) == []


def test_what_the_window_holds_back_is_dropped_before_what_came_later(session):
    session.window = 0
    for payload in (b"1", b"2"):
        session.offer(copy(payload))
    assert session.send(0.0) == []
    for payload in (b"3", b"4"):
        session.offer_dropping_oldest(copy(payload))
    session.window = 9
    assert payloads(session.send(0.0)) == [b"2", b"3", b"4"]


def test_no_more_is_under_way_than_the_client_takes_and_the_order_is_kept(session):
    session.window = 2
    for payload in (b"1", b"2", b"3"):
        session.offer(copy(payload))
    assert sent(session) == [(b"1", 1), (b"2", 2)]
    session.offer(copy(b"4"))
    session.forget(2)
    assert sent(session) == [(b"3", 3)]
    session.forget(1)
    assert sent(session) == [(b"4", 4)]


def test_what_needs_no_acknowledgement_overtakes_what_is_held_back(session):
    session.window = 1
    for payload, qos in ((b"1", 1), (b"2", 1), (b"fast", 0)):
        session.offer(copy(payload, qos))
    assert sent(session) == [(b"1", 1), (b"fast", None)]


@pytest.mark.parametrize(("now", "left"), [(4.0, 1), (4.1, 1), (2.5, 3), (5.0, None), (6.0, None)])
def test_a_message_tells_the_whole_seconds_left_and_is_not_sent_when_none_is(session, now, left):
    session.offer(copy(deadline=5.0))
    assert [packet.message_expiry_interval for packet in session.send(now)] == ([left] if left else [])
    session.offer(copy(deadline=None))
    assert [packet.message_expiry_interval for packet in session.send(now)] == [None]


def test_an_expired_message_takes_no_place_in_the_window(session):
    session.window = 1
    session.offer(copy(deadline=1.0))
    session.offer(copy(b"2"))
    assert sent(session, now=2.0) == [(b"2", 1)]


def test_what_was_not_acknowledged_is_sent_again_in_order_and_marked(session):
    for payload, qos in ((b"1", 1), (b"2", 2), (b"3", 2), (b"4", 0)):
        session.offer(copy(payload, qos, deadline=9.0))
    session.send(0.0)
    session.on_pubrec(mqtt5.PubRecPacket(3))
    again = session.resume(5.0)
    assert [(packet.packet_id, getattr(packet, "payload", None)) for packet in again] == [
        (1, b"1"),
        (2, b"2"),
        (3, None),  # it has the message: only its release is left
    ]
    assert [(packet.duplicate, packet.message_expiry_interval) for packet in again[:2]] == [(True, 4)] * 2
    assert session.resume(20.0)[0].message_expiry_interval == 0, "it was under way before it expired"


@pytest.mark.parametrize("reason", ONCE)
def test_a_message_that_goes_once_is_released_and_then_complete(session, reason):
    session.window = 1
    session.offer(copy(qos=2))
    session.send(0.0)
    for _ in range(2):  # the client may ask again
        release = session.on_pubrec(mqtt5.PubRecPacket(1, reason_code=reason))
        assert (release.packet_id, int(release.reason_code)) == (1, 0)
    session.offer(copy(b"2", qos=2))
    assert session.send(0.0) == [], "its place in the window is free only when it is complete"
    session.on_pubcomp(1)
    assert sent(session) == [(b"2", 2)]


def test_a_message_that_the_client_refuses_is_forgotten(session):
    session.offer(copy(qos=2))
    session.send(0.0)
    refusal = mqtt5.PubRecPacket(1, reason_code=mqtt5.PubRecReasonCode.QUOTA_EXCEEDED)
    assert session.on_pubrec(refusal) is None
    assert session.resume(0.0) == []


def test_the_release_of_an_unknown_message_says_so(session):
    release = session.on_pubrec(mqtt5.PubRecPacket(5))
    assert release.reason_code == mqtt5.PubRelReasonCode.PACKET_ID_NOT_FOUND
    assert session.resume(0.0) == []


def test_identifiers_begin_anew_after_the_last_and_leave_out_those_in_use(session):
    session.offer(copy(b"1"))
    session.offer(copy(b"2", qos=2))
    session.send(0.0)
    session.on_pubrec(mqtt5.PubRecPacket(2))
    session._last_id = 0xFFFE
    for payload in (b"3", b"4"):
        session.offer(copy(payload))
    assert sent(session) == [(b"3", 0xFFFF), (b"4", 3)]


def test_all_properties_of_a_message_pass_through(session):
    given = {
        "payload_format_indicator": 1,
        "content_type": "json",
        "response_topic": "b",
        "correlation_data": b"c",
        "user_properties": [("k", "v")],
    }
    one = copy(qos=2, **given)
    one.retain, one.identifiers, one.qos = True, [4, 5], 1
    session.offer(one)
    (packet,) = session.send(0.0)
    assert {name: getattr(packet, name) for name in given} == given
    assert (packet.retain, packet.subscription_ids, packet.qos) == (True, [4, 5], mqtt5.QoS.AT_LEAST_ONCE)
    assert not packet.duplicate
