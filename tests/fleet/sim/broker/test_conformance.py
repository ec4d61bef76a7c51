"""What MQTT brokers do, asked of the demo broker and of Mosquitto alike."""

import itertools
import socket

import mqtt5
import pytest
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.reasoncodes import ReasonCode

from fleet.cloud import v311

NOBODY = 0x10


@pytest.fixture(params=["broker", "mosquitto"])
def port(request):
    return request.getfixturevalue(request.param).port


@pytest.fixture
def new_client(port, clients):
    """Make a client of the broker under test, not connected yet."""
    return lambda name, **options: clients(port, name, **options)


both_versions = pytest.mark.parametrize("protocol", [5, 311])


@both_versions
@pytest.mark.parametrize(("sent", "wanted"), list(itertools.product(range(3), range(3))))
def test_a_message_arrives_at_the_lower_of_both_qualities(new_client, protocol, sent, wanted):
    alice, bob = (
        new_client("alice", protocol=protocol).connect(),
        new_client("bob", protocol=protocol).connect(),
    )
    assert bob.subscribe("a/b", wanted) == wanted
    alice.publish("a/b", b"hello \xff", sent)
    message = bob.next()
    assert (message.topic, message.payload, message.qos) == ("a/b", b"hello \xff", min(sent, wanted))
    assert bob.all() == []


@pytest.mark.parametrize(("talks", "listens"), [(5, 311), (311, 5)])
def test_the_versions_talk_to_each_other(new_client, talks, listens):
    alice, bob = new_client("alice", protocol=talks).connect(), new_client("bob", protocol=listens).connect()
    bob.subscribe("a/#", 2)
    alice.publish("a/b", b"across", 2)
    assert bob.next().payload == b"across"


@both_versions
@pytest.mark.parametrize("qos", [0, 1, 2])
def test_messages_of_one_quality_keep_their_order(new_client, protocol, qos):
    alice, bob = (
        new_client("alice", protocol=protocol).connect(),
        new_client("bob", protocol=protocol).connect(),
    )
    bob.subscribe("t", qos)
    for number in range(90):
        alice.send("t", str(number), qos)
    assert [int(bob.next().payload) for _ in range(90)] == list(range(90))


@both_versions
def test_a_large_message_arrives_whole(new_client, protocol):
    alice, bob = (
        new_client("alice", protocol=protocol).connect(),
        new_client("bob", protocol=protocol).connect(),
    )
    bob.subscribe("large", 1)
    payload = bytes(range(256)) * 8192
    alice.publish("large", payload, 1)
    assert bob.next().payload == payload


@both_versions
@pytest.mark.parametrize(
    ("pattern", "takes", "leaves"),
    [
        ("a/+/c", ["a/b/c", "a//c"], ["a/c", "a/b/c/d", "b/b/c"]),
        ("a/#", ["a", "a/b", "a/b/c"], ["b", "ab/c"]),
        ("+", ["a"], ["a/b", "/a"]),
        ("/+", ["/a", "/"], ["a", "/a/b"]),
        ("+/+", ["a/b", "/"], ["a", "$a/b"]),
        ("#", ["a", "a/b"], ["$a", "$a/b"]),
        ("$a/#", ["$a/b"], ["a/b"]),
    ],
)
def test_filters_take_what_they_should(new_client, protocol, pattern, takes, leaves):
    bob = new_client("bob", protocol=protocol).connect()
    bob.subscribe(pattern, 1)
    for topic in (*leaves, *takes):
        bob.send(topic, b"x", 1)
    marker = f"marker/{bob.name}"
    assert [m.topic for m in bob.all() if not m.topic.startswith(marker)] == takes


@both_versions
def test_a_retained_message_waits_for_subscribers_and_is_marked(new_client, protocol):
    alice = new_client("alice", protocol=protocol).connect()
    alice.publish("kept/1", b"old", 1, retain=True)
    alice.publish("kept/1", b"new", 1, retain=True)
    bob = new_client("bob", protocol=protocol).connect()
    bob.subscribe("kept/+", 1)
    message = bob.next()
    assert (message.payload, message.retain) == (b"new", True)
    alice.publish("kept/1", b"live", 1, retain=True)
    message = bob.next()
    assert (message.payload, message.retain) == (b"live", False)


@both_versions
def test_an_empty_retained_message_forgets_the_topic(new_client, protocol):
    alice = new_client("alice", protocol=protocol).connect()
    alice.publish("kept", b"old", 1, retain=True)
    alice.publish("kept", b"", 1, retain=True)
    alice.subscribe("kept", 1)
    assert alice.all() == []


@both_versions
def test_a_second_subscription_to_a_filter_replaces_the_first(new_client, protocol):
    bob = new_client("bob", protocol=protocol).connect()
    bob.subscribe("a", 0)
    bob.subscribe("a", 1)
    bob.send("a", b"once", 1)
    assert [(m.payload, m.qos) for m in bob.all()] == [(b"once", 1)]


@both_versions
def test_nothing_arrives_after_unsubscribing(new_client, protocol):
    bob = new_client("bob", protocol=protocol).connect()
    bob.subscribe("a", 1)
    assert bob.unsubscribe("a") in (0, None)
    bob.send("a", b"x", 1)
    assert bob.all() == []


@both_versions
def test_the_will_of_a_client_that_vanishes_is_published(new_client, protocol):
    alice, bob = new_client("alice", protocol=protocol), new_client("bob", protocol=protocol).connect()
    alice.will("gone", b"alice", 1, retain=True).connect()
    bob.subscribe("gone", 1)
    alice.drop_connection()
    message = bob.next()
    assert (message.payload, message.qos, message.retain) == (b"alice", 1, False)
    late = new_client("late", protocol=protocol).connect()
    late.subscribe("gone")
    assert late.next().retain


@both_versions
def test_the_will_of_a_client_that_falls_silent_is_published(new_client, protocol):
    alice, bob = (
        new_client("alice", protocol=protocol, keepalive=1),
        new_client("bob", protocol=protocol).connect(),
    )
    bob.subscribe("gone")
    alice.will("gone", b"alice").connect().stop_loop()
    assert bob.next().payload == b"alice"


@both_versions
def test_the_will_of_a_client_that_says_goodbye_is_not_published(new_client, protocol):
    alice, bob = new_client("alice", protocol=protocol), new_client("bob", protocol=protocol).connect()
    bob.subscribe("gone", 1)
    alice.will("gone", b"alice").connect().leave()
    assert bob.all() == []


def test_a_client_may_ask_for_its_will_at_the_goodbye(new_client):
    alice, bob = new_client("alice", protocol=5), new_client("bob", protocol=5).connect()
    bob.subscribe("gone")
    alice.will("gone", b"alice").connect()
    alice.leave(ReasonCode(PacketTypes.DISCONNECT, "Disconnect with will message"))
    assert bob.next().payload == b"alice"


def test_a_delayed_will_is_not_published_when_the_client_comes_back(new_client):
    alice, bob = (
        new_client("alice", protocol=5, SessionExpiryInterval=60),
        new_client("bob", protocol=5).connect(),
    )
    bob.subscribe("gone", 1)
    alice.will("gone", b"alice", delay=60).connect().drop_connection()
    new_client("alice", protocol=5).connect().leave()
    assert bob.all() == []


@both_versions
def test_a_second_client_of_the_same_name_takes_over(new_client, protocol):
    first, second = new_client("twin", protocol=protocol).connect(), new_client("twin", protocol=protocol)
    second.connect()
    assert first.gone.wait(60)
    second.subscribe("a", 1)
    second.publish("a", b"mine", 1)
    assert second.next().payload == b"mine"


def lasting(protocol):
    return {"fresh": False} | ({"SessionExpiryInterval": 60} if protocol == 5 else {})


@both_versions
@pytest.mark.parametrize("qos", [1, 2])
def test_a_lasting_session_keeps_subscriptions_and_messages(new_client, protocol, qos):
    bob = new_client("bob", protocol=protocol, **lasting(protocol)).connect()
    assert not bob.connack.present
    bob.subscribe("a", 2)
    bob.leave()
    alice = new_client("alice", protocol=protocol).connect()
    for number in range(3):
        alice.publish("a", str(number), qos)
    back = new_client("bob", protocol=protocol, **lasting(protocol)).connect()
    assert back.connack.present
    assert [back.next().payload for _ in range(3)] == [b"0", b"1", b"2"]


@both_versions
def test_a_fresh_start_forgets_the_session(new_client, protocol):
    bob = new_client("bob", protocol=protocol, **lasting(protocol)).connect()
    bob.subscribe("a", 1)
    bob.leave()
    assert not new_client("bob", protocol=protocol).connect().connack.present


def test_a_session_without_expiry_ends_with_its_connection(new_client):
    new_client("bob", protocol=5, fresh=False).connect().leave()
    assert not new_client("bob", protocol=5, fresh=False).connect().connack.present


@both_versions
def test_what_was_not_acknowledged_comes_again_as_a_duplicate(new_client, protocol):
    bob = new_client("bob", protocol=protocol, manual=True, **lasting(protocol)).connect()
    bob.subscribe("a", 1)
    alice = new_client("alice", protocol=protocol).connect()
    for number in range(3):
        alice.publish("a", str(number), 1)
    assert [bob.next().dup for _ in range(3)] == [False] * 3
    bob.drop_connection()
    back = new_client("bob", protocol=protocol, **lasting(protocol)).connect()
    assert [(m.payload, m.dup) for m in (back.next(), back.next(), back.next())] == [
        (b"0", True),
        (b"1", True),
        (b"2", True),
    ]


def test_properties_pass_through_unchanged(new_client):
    alice, bob = new_client("alice", protocol=5).connect(), new_client("bob", protocol=5).connect()
    bob.subscribe("a", 1)
    pairs = [("k", "1"), ("k", "2"), ("ü", "")]
    alice.publish(
        "a",
        b"{}",
        1,
        UserProperty=pairs,
        ResponseTopic="inbox/alice",
        CorrelationData=b"\x00\xff",
        ContentType="application/json",
        PayloadFormatIndicator=1,
        MessageExpiryInterval=60,
    )
    came = bob.next().properties
    assert came.UserProperty == pairs
    assert (came.ResponseTopic, came.CorrelationData) == ("inbox/alice", b"\x00\xff")
    assert (came.ContentType, came.PayloadFormatIndicator) == ("application/json", 1)
    assert 0 < came.MessageExpiryInterval <= 60


def test_subscription_identifiers_come_with_the_messages(new_client):
    bob = new_client("bob", protocol=5).connect()
    bob.subscribe("a/+", 1, identifier=7)
    bob.publish("a/b", b"", 1)
    assert bob.next().properties.SubscriptionIdentifier == [7]


def test_the_sender_gets_an_error_when_nobody_listens(new_client):
    alice = new_client("alice", protocol=5).connect()
    assert alice.publish("nobody", b"", 1) == NOBODY
    alice.subscribe("nobody")
    assert alice.publish("nobody", b"", 1) == 0


def test_no_local_leaves_out_what_the_client_says_itself(new_client):
    alice, bob = new_client("alice", protocol=5).connect(), new_client("bob", protocol=5).connect()
    bob.subscribe("a", 1, noLocal=True)
    bob.publish("a", b"own", 1)
    alice.publish("a", b"other", 1)
    assert bob.next().payload == b"other"


def test_retain_as_published_keeps_the_mark(new_client):
    bob = new_client("bob", protocol=5).connect()
    bob.subscribe("a", 1, retainAsPublished=True)
    bob.publish("a", b"kept", 1, retain=True)
    bob.publish("a", b"live", 1)
    assert [(m.payload, m.retain) for m in bob.all()] == [(b"kept", True), (b"live", False)]


@pytest.mark.parametrize(("handling", "times"), [(0, 2), (1, 1), (2, 0)])
def test_retain_handling_says_when_kept_messages_come(new_client, handling, times):
    bob = new_client("bob", protocol=5).connect()
    bob.publish("a", b"kept", 1, retain=True)
    bob.subscribe("a", 1, retainHandling=handling)
    bob.subscribe("a", 1, retainHandling=handling)
    assert bob.payloads() == [b"kept"] * times


def test_a_client_gets_no_more_at_once_than_its_receive_maximum(new_client):
    bob = new_client("bob", protocol=5, manual=True, ReceiveMaximum=2).connect()
    bob.subscribe("a/+", 1)
    alice = new_client("alice", protocol=5).connect()
    for number in range(5):
        alice.publish(f"a/{number}", b"", 1)
    bob.subscribe("light")
    alice.publish("light")
    came = [bob.next() for _ in range(3)]
    assert sorted(message.topic for message in came) == ["a/0", "a/1", "light"]
    bob.paho.ack(next(message.mid for message in came if message.topic == "a/0"), 1)
    assert bob.next().topic == "a/2"


def test_what_is_larger_than_a_client_takes_is_left_out(new_client):
    bob = new_client("bob", protocol=5, MaximumPacketSize=200).connect()
    bob.subscribe("a", 1)
    bob.send("a", b"small", 1)
    assert bob.next().payload == b"small"  # before another client's: brokers keep the order of one alone
    alice = new_client("alice", protocol=5).connect()
    alice.publish("a", b"x" * 500, 1)
    alice.publish("a", b"small again", 1)
    assert bob.next().payload == b"small again"


@both_versions
def test_a_client_without_a_name_is_let_in(new_client, protocol):
    nameless = new_client("", protocol=protocol).connect()
    nameless.subscribe("a", 1)
    nameless.publish("a", b"x", 1)
    assert nameless.next().payload == b"x"
    if protocol == 5:
        assert nameless.connack.properties.AssignedClientIdentifier


CONNECT_5 = mqtt5.ConnectPacket("mallory", clean_start=True).write()
CONNECT_311 = v311.write(mqtt5.ConnectPacket("mallory", clean_start=True))


@pytest.mark.parametrize("connect", [b"", CONNECT_5, CONNECT_311], ids=["before", "mqtt5", "mqtt311"])
@pytest.mark.parametrize(
    "bad",
    [
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
        b"\x00\x00",
        b"\x10\xff\xff\xff\xff\x7f",
        b"\x30\x02\x00\x09",
        b"\x3e\x03\x00\x01a",
        b"\x32\x05\x00\x01a\x00\x00",
        b"\x30\x04\x00\x02\xc3\x28",
        b"\x30\x06\x00\x03a/#\x00",
        b"\x82\x02\x00\x01",
        b"\x80\x07\x00\x01\x00\x00\x01a\x00",
        b"\x82\x0a\x00\x01\x00\x00\x04a/#b\x00",
        b"\x82\x06\x00\x01\x00\x00\x00\x00",
        b"\xf0\x7f" + bytes(0x7F),
        CONNECT_5,
        CONNECT_311,
    ],
)
def test_a_client_that_breaks_the_protocol_is_cut_off_alone(port, new_client, raw, connect, bad):
    if not connect and bad in (CONNECT_5, CONNECT_311):
        bad += bad
    bob = new_client("bob", protocol=5).connect()
    mallory = raw(port, connect + bad)
    assert ends(mallory)
    bob.subscribe("a", 1)
    bob.publish("a", b"still here", 1)
    assert bob.next().payload == b"still here"


def ends(connection: socket.socket) -> bool:
    try:
        while connection.recv(4096):
            pass
    except ConnectionError:
        pass
    return True


def test_a_nameless_session_of_the_older_version_cannot_last(port, raw):
    packet = v311.write(mqtt5.ConnectPacket("", clean_start=False, session_expiry_interval=60))
    assert raw(port, packet).recv(16) == b"\x20\x02\x00\x02"
