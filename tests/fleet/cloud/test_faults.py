"""What the client makes of a broker that misbehaves."""

import socket

import mqtt5

from fleet.cloud.values import CloudState
from fleet.sim.broker import BrokerThread, ClientLimits
from fleet.wire.rules import TrafficClass

WINDOW, RESERVED = 100, 12  # QoS 1 messages under way; those of them that only urgent ones may use


def numbered(count):
    return [b"%d" % number for number in range(count)]


def test_the_window_keeps_room_for_what_is_urgent(broker, watched):
    receiver = watched(broker.port, "receiver", {"t": 1, "inbox": 1}).connected()
    says = watched(broker.port, "says").connected()
    says.publish("t", b"-", qos=1)
    says.acked(1)
    broker.broker.faults.no_puback = True
    for payload in numbered(200):
        says.publish("t", payload, qos=1)
    says.client.flush()
    assert receiver.payloads(WINDOW - RESERVED + 1)[1:] == numbered(WINDOW - RESERVED)
    says.publish("inbox", b"stop", qos=1, traffic=TrafficClass.REPLY)
    assert receiver.payloads(WINDOW - RESERVED + 2)[-1] == b"stop"
    assert (says.client.stats.inflight, says.client.stats.queued) == (89, 112)


def test_a_broker_that_forgot_us_is_noticed(broker, watched):
    edge = watched(broker.port, keepalive=1).connected()
    broker.call(broker.broker.half_open, "edge")
    edge.reaches(CloudState.DISCONNECTED, "silent")
    edge.until(lambda: edge.client.stats.connects == 2)


def test_the_reason_that_the_broker_gives_is_reported(broker, watched):
    edge = watched(broker.port).connected()
    broker.call(broker.broker.disconnect_all, mqtt5.DisconnectReasonCode.SERVER_SHUTTING_DOWN)
    edge.reaches(CloudState.DISCONNECTED, "the broker is shutting down")
    edge.until(lambda: edge.client.stats.connects == 2)


def test_a_message_that_the_broker_would_not_take_is_refused_alone(watched):
    with BrokerThread(limits=ClientLimits(packet=1000)) as running:
        watched(running.port, "receiver", {"#": 1}).connected()
        edge = watched(running.port).connected()
        edge.publish("large", bytes(2000), qos=1)
        edge.publish("small", bytes(500), qos=1)
        edge.acked(1)
    assert edge.client.stats.refused == 1


def test_what_arrives_twice_is_handed_over_twice(broker, watched):
    receiver = watched(broker.port, "receiver", {"t": 1}).connected()
    broker.broker.faults.duplicate = "#"
    watched(broker.port, "says").connected().publish("t", b"x", qos=1)
    assert receiver.payloads(2) == [b"x", b"x"]


def test_small_packets_do_not_wait_for_one_another(broker, watched):
    edge = watched(broker.port).connected()
    carried = edge.client._connection._stream._socket
    assert carried.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
