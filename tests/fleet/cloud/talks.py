"""One session of MQTT, and what it says, read back as packets."""

import mqtt5

from fleet.cloud.mqtt_session import MqttSession
from fleet.cloud.outbound_queue import OutboundQueue
from fleet.cloud.packets import PacketDecoder
from fleet.cloud.publish import qos0_route
from fleet.cloud.values import CloudSettings, CloudStats, Will
from fleet.spool.message import DeliveryOutcome, Outgoing
from fleet.spool.queue import NEWEST_FIRST
from fleet.spool.spool import Spool, SpoolSettings
from fleet.testing.clock import ManualClock

ACKED, HELD, REFUSED = (1, 0, 0), (0, 1, 0), (0, 0, 1)  # what became of one message
SETTINGS = CloudSettings(host="h", client_id="me", username="u", password="p", will=Will("t", b"gone", 1))


class Talk:
    """A session, and what it says as packets."""

    def __init__(self, subscriptions=(), *, box=None, clock=None, **connack):
        self.stats = CloudStats()
        self.clock = clock or ManualClock()
        self.box = box or a_box(self.stats, self.clock)
        self.box.go_online()
        self.clock.advance(NEWEST_FIRST)
        self.session = MqttSession(SETTINGS, dict(subscriptions), self.box, self.stats)
        self.hear(mqtt5.ConnAckPacket(**connack))

    def hear(self, *packets):
        for packet in packets:
            self.session.receive(packet, self.clock.monotonic())

    def replies(self):
        return read(self.session.take_replies())

    def send(self):
        """Send until there is no more to send."""
        sent = []
        while data := self.session.send(self.clock.monotonic()):
            sent += read(data)
        return sent

    def put(self, *messages):
        for one in messages:
            self.box.spool.put(one)

    def light(self, topic, payload=b"x", expiry=None):
        self.box.put_qos0(qos0_route(topic, expiry), payload)

    def outcomes(self):
        """How many were acknowledged, held and refused."""
        return tuple(
            self.stats.outcomes[one]
            for one in (DeliveryOutcome.ACKED, DeliveryOutcome.HELD, DeliveryOutcome.REFUSED)
        )


def a_box(stats=None, clock=None):
    clock = clock or ManualClock()
    return OutboundQueue(Spool(SpoolSettings(), clock), 1000, 10**6, stats or CloudStats(), clock)


def read(data):
    return list(PacketDecoder(5, 10**7).feed(data))


def message(topic, qos=1, **more):
    return Outgoing(topic, b"x", qos, **more)


def ids(packets):
    return [(packet.topic, packet.packet_id, packet.duplicate) for packet in packets]
