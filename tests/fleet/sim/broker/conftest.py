import contextlib
import itertools
import queue
import socket
import threading

import paho.mqtt.client as paho
import pytest
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.subscribeoptions import SubscribeOptions

WITHIN = 60.0  # s
VERSIONS = {5: paho.MQTTv5, 311: paho.MQTTv311}


def properties(kind, **values):
    """Return MQTT 5 properties: ``properties(PacketTypes.PUBLISH, MessageExpiryInterval=1)``."""
    filled = Properties(kind)
    for name, value in values.items():
        setattr(filled, name, value)
    return filled


class WaitingClient:
    """One paho client that waits for every answer; what it receives is read in order."""

    _numbers = itertools.count()

    def __init__(
        self, port, name, *, protocol, fresh=True, keepalive=60, manual=False, login=None, **connect
    ):
        self.protocol = protocol
        self.name = name
        self.came = queue.Queue()
        self.gone = threading.Event()
        self.why = None
        self.connack = None
        self._answers = queue.Queue()
        extra = {"clean_session": fresh} if protocol == 311 else {}
        self.paho = paho.Client(
            paho.CallbackAPIVersion.VERSION2,
            name,
            protocol=VERSIONS[protocol],
            reconnect_on_failure=False,
            manual_ack=manual,
            **extra,
        )
        self._wire()
        if login:
            self.paho.username_pw_set(*login)
        self._fresh = fresh
        self._port = port
        self._keepalive = keepalive
        self._connect = connect

    def will(self, topic, payload, qos=0, *, retain=False, delay=None):
        """Leave a last message with the broker."""
        more = {} if delay is None else {"WillDelayInterval": delay}
        chosen = properties(PacketTypes.WILLMESSAGE, **more) if self.protocol == 5 else None
        self.paho.will_set(topic, payload, qos, retain, chosen)
        return self

    def send_connect(self):
        """Send CONNECT and wait for the answer, whatever it is."""
        extra = {}
        if self.protocol == 5:
            extra = {
                "clean_start": self._fresh,
                "properties": properties(PacketTypes.CONNECT, **self._connect),
            }
        self.paho.connect("127.0.0.1", self._port, self._keepalive, **extra)
        self.paho.loop_start()
        self.connack = self._answers.get(timeout=WITHIN)
        return self

    def connect(self):
        """Connect; the broker must agree."""
        self.send_connect()
        assert not self.connack.reason.is_failure, self.connack.reason
        return self

    def subscribe(self, pattern, qos=0, *, identifier=None, **options):
        """Subscribe and return the broker's answer, as a number."""
        if self.protocol == 311:
            self.paho.subscribe(pattern, qos)
        else:
            more = {} if identifier is None else {"SubscriptionIdentifier": identifier}
            chosen = properties(PacketTypes.SUBSCRIBE, **more)
            self.paho.subscribe(pattern, options=SubscribeOptions(qos=qos, **options), properties=chosen)
        return self._answers.get(timeout=WITHIN)

    def unsubscribe(self, pattern):
        """Unsubscribe and return the broker's answer."""
        self.paho.unsubscribe(pattern)
        return self._answers.get(timeout=WITHIN)

    def publish(self, topic, payload=b"", qos=0, *, retain=False, **more):
        """Publish and return the broker's answer as a number; QoS 0 has none."""
        chosen = properties(PacketTypes.PUBLISH, **more) if self.protocol == 5 else None
        self.paho.publish(topic, payload, qos, retain, chosen)
        return self._answers.get(timeout=WITHIN)

    def send(self, topic, payload=b"", qos=0, **more):
        """Publish without waiting."""
        self.paho.publish(topic, payload, qos, **more)

    def next(self):
        """Return the next message."""
        return self.came.get(timeout=WITHIN)

    def all(self):
        """Return everything that came before a message that is sent to itself now."""
        marker = f"marker/{self.name}/{next(self._numbers)}"
        self.subscribe(marker, 1)
        self.send(marker, b"", 1)
        return list(itertools.takewhile(lambda message: message.topic != marker, iter(self.next, None)))

    def payloads(self):
        """Return the payloads of everything that came."""
        return [message.payload for message in self.all()]

    def stop_loop(self):
        """Send and read nothing any more; the socket stays open."""
        with contextlib.suppress(AttributeError):  # paho forgets its thread when that ends, which may be now
            self.paho.loop_stop()

    def drop_connection(self):
        """Cut the connection without a goodbye."""
        self.paho.socket().shutdown(socket.SHUT_RDWR)
        assert self.gone.wait(WITHIN)
        self.stop_loop()

    def leave(self, reason=None):
        """Say goodbye."""
        self.paho.disconnect(**({} if reason is None else {"reasoncode": reason}))
        assert self.gone.wait(WITHIN)
        self.stop_loop()

    def close(self):
        """Leave nothing behind, however the test ended."""
        self.paho.disconnect()
        self.stop_loop()
        self.paho._reset_sockets()

    def _wire(self):
        """Put paho's callbacks where tests can wait for them."""
        client = self.paho

        def connected(_client, _data, flags, reason, answer):
            self._answers.put(Connack(flags.session_present, reason, answer))

        def disconnected(_client, _data, _flags, reason, _properties):
            self.why = reason
            self.gone.set()

        client.on_connect = connected
        client.on_disconnect = disconnected
        client.on_message = lambda _client, _data, message: self.came.put(message)
        client.on_publish = lambda _client, _data, _number, reason, _: self._answers.put(reason.value)
        client.on_subscribe = lambda _client, _data, _number, reasons, _: self._answers.put(reasons[0].value)
        client.on_unsubscribe = lambda _client, _data, _number, reasons, _: self._answers.put(
            reasons[0].value if reasons else None
        )


class Connack:
    """The broker's answer to CONNECT."""

    def __init__(self, present, reason, answer):
        self.present = present
        self.reason = reason
        self.properties = answer


@pytest.fixture
def clients():
    """Make paho clients: ``clients(port, name, protocol=5)``; they are closed when the test ends."""
    made = []

    def make(port, name, **options):
        made.append(WaitingClient(port, name, **options))
        return made[-1]

    yield make
    for client in made:
        client.close()


@pytest.fixture
def raw():
    """Open bare sockets; they are closed when the test ends."""
    opened = []

    def connect(port, data=b""):
        opened.append(socket.create_connection(("127.0.0.1", port), timeout=WITHIN))
        opened[-1].sendall(data)
        return opened[-1]

    yield connect
    for each in opened:
        each.close()
