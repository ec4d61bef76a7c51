"""No client can cost the demo broker more than it is allowed to."""

import mqtt5
import pytest

from fleet.sim.broker import BrokerThread, ClientLimits
from fleet.testing.clock import ManualClock
from tests.tools.waiting import wait_until

BAD_LOGIN = 0x86
QUOTA_EXCEEDED = 0x97


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def new_client(request, clock, clients):
    """Make clients of a broker with the limits that the test names."""
    options = {"clock": clock} | getattr(request, "param", {})
    with BrokerThread(**options) as running:
        clients.running = running

        def make(name, **options):
            return clients(running.port, name, protocol=5, **options)

        make.running = running
        yield make


def limits(**values):
    return pytest.mark.parametrize(
        "new_client", [{"limits": ClientLimits(**values)}], indirect=True, ids=[""]
    )


@limits(queue=4)
def test_a_client_that_does_not_read_is_expelled(new_client, raw):
    hello = (
        mqtt5.ConnectPacket("sloth", clean_start=True),
        mqtt5.SubscribePacket(1, [mqtt5.TopicFilter("large")]),
    )
    raw(new_client.running.port, b"".join(packet.write() for packet in hello))
    wait_until("the sloth is in", lambda: new_client.running.broker.clients == ["sloth"])
    alice = new_client("alice").connect()
    for _ in range(30):
        alice.publish("large", bytes(1024 * 1024), 1)
    wait_until("the sloth is out", lambda: new_client.running.broker.clients == ["alice"])


def test_what_is_too_large_for_a_client_does_not_fill_its_window(new_client):
    bob = new_client("bob", MaximumPacketSize=200, ReceiveMaximum=1).connect()
    bob.subscribe("a", 1)
    alice = new_client("alice").connect()
    for payload in (b"x" * 500, b"y" * 500, b"small"):
        alice.send("a", payload, 1)
    assert bob.next().payload == b"small"


@limits(queue=3)
def test_a_client_that_is_away_loses_the_oldest(new_client):
    bob = new_client("bob", SessionExpiryInterval=60).connect()
    bob.subscribe("a", 1)
    bob.leave()
    alice = new_client("alice").connect()
    for number in range(5):
        alice.publish("a", str(number), 1)
    back = new_client("bob", fresh=False, SessionExpiryInterval=60).connect()
    assert [back.next().payload for _ in range(3)] == [b"2", b"3", b"4"]


@limits(sessions=1)
def test_there_is_room_for_so_many_clients(new_client):
    alice = new_client("alice").connect()
    assert new_client("bob").send_connect().connack.reason.value == QUOTA_EXCEEDED
    alice.leave()
    new_client("bob").connect()


@limits(retained=1)
def test_a_full_store_keeps_no_new_topic(new_client):
    alice = new_client("alice").connect()
    alice.publish("a", b"first", 1, retain=True)
    alice.publish("b", b"too many", 1, retain=True)
    alice.publish("a", b"newer", 1, retain=True)
    alice.subscribe("+", 1)
    assert alice.payloads() == [b"newer"]


@limits(retained_bytes=100)
def test_a_full_store_keeps_no_more_bytes(new_client):
    alice = new_client("alice").connect()
    for topic, size in (("a", 60), ("b", 60), ("a", 90), ("c", 10)):
        alice.publish(topic, bytes(size), 1, retain=True)
    alice.subscribe("+", 1)
    assert {message.topic: len(message.payload) for message in alice.all()} == {"a": 90, "c": 10}


@limits(subscriptions=1)
def test_one_subscription_too_many_is_refused(new_client):
    alice = new_client("alice").connect()
    assert alice.subscribe("a", 1) == 1
    assert alice.subscribe("b", 1) == QUOTA_EXCEEDED
    assert alice.subscribe("a", 2) == 2


@limits(packet=1000)
def test_a_packet_that_is_too_large_ends_the_connection(new_client):
    alice = new_client("alice").connect()
    assert alice.connack.properties.MaximumPacketSize == 1000
    alice.send("a", bytes(2000), 1)
    assert alice.gone.wait(60)
    assert alice.why.getName() == "Packet too large"


@pytest.mark.parametrize(
    "new_client", [{"limits": ClientLimits(connect_timeout=0.1), "clock": None}], indirect=True
)
def test_who_does_not_say_connect_is_cut_off(new_client, raw):
    assert raw(new_client.running.port).recv(1) == b""


def allow(name, password):
    return (name, password) == ("edge", b"secret")


@pytest.mark.parametrize("new_client", [{"check": allow}], indirect=True)
def test_names_and_passwords_are_checked(new_client):
    new_client("right", login=("edge", "secret")).connect()
    assert new_client("wrong", login=("edge", "wrong")).send_connect().connack.reason.value == BAD_LOGIN
    assert new_client("none").send_connect().connack.reason.value == BAD_LOGIN


@pytest.mark.parametrize(("away", "present"), [(59, True), (61, False)])
def test_a_session_lasts_as_long_as_it_was_asked_for(new_client, clock, away, present):
    new_client("bob", SessionExpiryInterval=60).connect().leave()
    wait_until("bob is away", lambda: not new_client.running.broker.clients)
    clock.advance(away)
    assert new_client("bob", fresh=False).connect().connack.present is present


def test_a_message_that_waited_too_long_is_not_delivered(new_client, clock):
    bob = new_client("bob", SessionExpiryInterval=60).connect()
    bob.subscribe("a", 1)
    bob.leave()
    alice = new_client("alice").connect()
    alice.publish("a", b"short", 1, retain=True, MessageExpiryInterval=5)
    alice.publish("a", b"long", 1, MessageExpiryInterval=30)
    clock.advance(10)
    message = new_client("bob", fresh=False).connect().next()
    assert (message.payload, message.properties.MessageExpiryInterval) == (b"long", 20)
    alice.subscribe("a", 1)
    assert alice.all() == []
