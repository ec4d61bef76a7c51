"""No client can cost the demo broker more than it is allowed to."""

import mqtt5
import pytest

from fleet.sim.broker import BrokerThread, ClientLimits
from fleet.testing.clock import ManualClock
from fleet.testing.waiting import wait_until

BAD_LOGIN = 0x86
QUOTA_EXCEEDED = 0x97


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def guest(request, clock, guests):
    """Make clients of a broker with the limits that the test names."""
    options = {"clock": clock} | getattr(request, "param", {})
    with BrokerThread(**options) as running:
        guests.running = running

        def make(name, **options):
            return guests(running.port, name, protocol=5, **options)

        make.running = running
        yield make


def limits(**values):
    return pytest.mark.parametrize("guest", [{"limits": ClientLimits(**values)}], indirect=True, ids=[""])


@limits(queue=4)
def test_a_client_that_does_not_read_is_expelled(guest, raw):
    hello = (
        mqtt5.ConnectPacket("sloth", clean_start=True),
        mqtt5.SubscribePacket(1, [mqtt5.TopicFilter("large")]),
    )
    raw(guest.running.port, b"".join(packet.write() for packet in hello))
    wait_until("the sloth is in", lambda: guest.running.broker.clients == ["sloth"])
    alice = guest("alice").enter()
    for _ in range(30):
        alice.publish("large", bytes(1024 * 1024), 1)
    wait_until("the sloth is out", lambda: guest.running.broker.clients == ["alice"])


def test_what_is_too_large_for_a_client_does_not_fill_its_window(guest):
    bob = guest("bob", MaximumPacketSize=200, ReceiveMaximum=1).enter()
    bob.subscribe("a", 1)
    alice = guest("alice").enter()
    for payload in (b"x" * 500, b"y" * 500, b"small"):
        alice.send("a", payload, 1)
    assert bob.next().payload == b"small"


@limits(queue=3)
def test_a_client_that_is_away_loses_the_oldest(guest):
    bob = guest("bob", SessionExpiryInterval=60).enter()
    bob.subscribe("a", 1)
    bob.leave()
    alice = guest("alice").enter()
    for number in range(5):
        alice.publish("a", str(number), 1)
    back = guest("bob", fresh=False, SessionExpiryInterval=60).enter()
    assert [back.next().payload for _ in range(3)] == [b"2", b"3", b"4"]


@limits(sessions=1)
def test_there_is_room_for_so_many_clients(guest):
    alice = guest("alice").enter()
    assert guest("bob").knock().connack.reason.value == QUOTA_EXCEEDED
    alice.leave()
    guest("bob").enter()


@limits(retained=1)
def test_a_full_store_keeps_no_new_topic(guest):
    alice = guest("alice").enter()
    alice.publish("a", b"first", 1, retain=True)
    alice.publish("b", b"too many", 1, retain=True)
    alice.publish("a", b"newer", 1, retain=True)
    alice.subscribe("+", 1)
    assert alice.payloads() == [b"newer"]


@limits(retained_bytes=100)
def test_a_full_store_keeps_no_more_bytes(guest):
    alice = guest("alice").enter()
    for topic, size in (("a", 60), ("b", 60), ("a", 90), ("c", 10)):
        alice.publish(topic, bytes(size), 1, retain=True)
    alice.subscribe("+", 1)
    assert {message.topic: len(message.payload) for message in alice.all()} == {"a": 90, "c": 10}


@limits(subscriptions=1)
def test_one_subscription_too_many_is_refused(guest):
    alice = guest("alice").enter()
    assert alice.subscribe("a", 1) == 1
    assert alice.subscribe("b", 1) == QUOTA_EXCEEDED
    assert alice.subscribe("a", 2) == 2


@limits(packet=1000)
def test_a_packet_that_is_too_large_ends_the_connection(guest):
    alice = guest("alice").enter()
    assert alice.connack.properties.MaximumPacketSize == 1000
    alice.send("a", bytes(2000), 1)
    assert alice.gone.wait(60)
    assert alice.why.getName() == "Packet too large"


@pytest.mark.parametrize(
    "guest", [{"limits": ClientLimits(connect_timeout=0.1), "clock": None}], indirect=True
)
def test_who_does_not_say_connect_is_cut_off(guest, raw):
    assert raw(guest.running.port).recv(1) == b""


def allow(name, password):
    return (name, password) == ("edge", b"secret")


@pytest.mark.parametrize("guest", [{"check": allow}], indirect=True)
def test_names_and_passwords_are_checked(guest):
    guest("right", login=("edge", "secret")).enter()
    assert guest("wrong", login=("edge", "wrong")).knock().connack.reason.value == BAD_LOGIN
    assert guest("none").knock().connack.reason.value == BAD_LOGIN


@pytest.mark.parametrize(("away", "present"), [(59, True), (61, False)])
def test_a_session_lasts_as_long_as_it_was_asked_for(guest, clock, away, present):
    guest("bob", SessionExpiryInterval=60).enter().leave()
    wait_until("bob is away", lambda: not guest.running.broker.clients)
    clock.advance(away)
    assert guest("bob", fresh=False).enter().connack.present is present


def test_a_message_that_waited_too_long_is_not_delivered(guest, clock):
    bob = guest("bob", SessionExpiryInterval=60).enter()
    bob.subscribe("a", 1)
    bob.leave()
    alice = guest("alice").enter()
    alice.publish("a", b"short", 1, retain=True, MessageExpiryInterval=5)
    alice.publish("a", b"long", 1, MessageExpiryInterval=30)
    clock.advance(10)
    message = guest("bob", fresh=False).enter().next()
    assert (message.payload, message.properties.MessageExpiryInterval) == (b"long", 20)
    alice.subscribe("a", 1)
    assert alice.all() == []
