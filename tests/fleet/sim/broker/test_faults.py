"""The demo broker misbehaves as it is told."""

import time

import mqtt5
import pytest

from tests.tools.waiting import wait_until

NOT_AUTHORIZED = 0x87
SHUTTING_DOWN = 0x8B


@pytest.fixture
def new_client(broker, clients):
    return lambda name, protocol=5, **options: clients(broker.port, name, protocol=protocol, **options)


@pytest.fixture
def faults(broker):
    return broker.broker.faults


def test_what_is_dropped_is_acknowledged_and_goes_nowhere(new_client, faults):
    bob = new_client("bob").connect()
    bob.subscribe("#", 1)
    faults.drop = "lost/#"
    assert bob.publish("lost/a", b"x", 1) == 0
    bob.publish("kept/a", b"x", 1)
    assert bob.next().topic == "kept/a"


def test_what_is_duplicated_arrives_twice(new_client, faults):
    bob = new_client("bob").connect()
    bob.subscribe("twice/+", 1)
    faults.duplicate = "twice/#"
    bob.send("twice/a", b"x", 1)
    assert bob.payloads() == [b"x", b"x"]


def test_what_is_delayed_arrives_later(new_client, faults):
    bob = new_client("bob").connect()
    bob.subscribe("a", 1)
    faults.delay = 0.2
    began = time.monotonic()
    bob.publish("a", b"x", 1)
    assert bob.next().payload == b"x"
    assert time.monotonic() - began >= 0.2


def test_without_acknowledgements_messages_still_arrive(new_client, faults):
    bob = new_client("bob").connect()
    bob.subscribe("a", 0)
    faults.no_puback = True
    bob.send("a", b"x", 1)
    assert bob.next().payload == b"x"
    granted = 2
    assert bob.subscribe("b", granted) == granted  # the next answer is not the acknowledgement


@pytest.mark.parametrize("protocol", [5, 311])
def test_every_client_is_refused_with_the_reason(new_client, faults, protocol):
    faults.refuse = NOT_AUTHORIZED
    assert new_client("bob", protocol=protocol).send_connect().connack.reason.value == NOT_AUTHORIZED


def test_a_frozen_broker_neither_answers_nor_forgets(new_client, faults, broker, raw):
    connection = raw(broker.port, mqtt5.ConnectPacket("mallory", clean_start=True).write())
    assert connection.recv(256)
    faults.freeze = True
    connection.sendall(mqtt5.PingReqPacket().write())
    connection.settimeout(0.5)
    with pytest.raises(TimeoutError):
        connection.recv(2)
    faults.freeze = False
    connection.settimeout(60)
    assert connection.recv(2) == mqtt5.PingRespPacket().write()


def test_all_clients_get_the_reason_of_the_disconnection(new_client, broker):
    alice, bob = new_client("alice").connect(), new_client("bob", protocol=311).connect()
    broker.call(broker.broker.disconnect_all, SHUTTING_DOWN)
    assert alice.gone.wait(60)
    assert bob.gone.wait(60)
    assert alice.why.value == SHUTTING_DOWN


def test_all_clients_are_cut_off_without_a_word(new_client, broker):
    alice, bob = new_client("alice").will("gone", b"alice").connect(), new_client("bob").connect()
    broker.call(broker.broker.disconnect_all)
    assert alice.gone.wait(60)
    assert bob.gone.wait(60)
    wait_until("nobody is left", lambda: not broker.broker.clients)


def test_a_half_open_client_is_forgotten_while_its_socket_stays_open(new_client, broker):
    alice, bob = new_client("alice").will("gone", b"alice").connect(), new_client("bob").connect()
    bob.subscribe("gone")
    broker.call(broker.broker.half_open, "alice")
    assert bob.next().payload == b"alice"
    alice.send("a", b"x", 1)
    assert broker.broker.clients == ["bob"]
    assert not alice.gone.is_set()
