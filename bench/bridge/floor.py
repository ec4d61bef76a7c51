"""The floor: minimal bridges without translation, validation, reconnect or spool.

They are lower bounds, not shippable designs. Run as ``python -m bench.bridge.floor ROLE ARGUMENTS``.
"""

import collections
import itertools
import json
import struct
import sys
import threading
import time

import mqtt5
import msgspec
import zenoh

from bench.common import bare_client
from fleet.cloud.packets import PacketDecoder

WINDOW = 2000  # QoS 1 messages in flight


def session(listen="", connect=""):
    """Open a Zenoh session on loopback: a client with ``connect``, a router with ``listen``, else a peer."""
    config = zenoh.Config()
    config.insert_json5("mode", '"router"' if listen else '"client"' if connect else '"peer"')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("listen/endpoints", json.dumps([f"tcp/127.0.0.1:{listen}"] if listen else []))
    config.insert_json5("connect/endpoints", json.dumps([f"tcp/127.0.0.1:{connect}"] if connect else []))
    return zenoh.open(config)


def topic_of(key):
    """Return the MQTT topic of a bus key."""
    _, twin, _, channel = key.split("/", 3)
    return f"cyberwave/twin/{twin}/{channel}"


class PublishBuilder:
    """Builder of PUBLISH packets that caches the encoded topic."""

    def __init__(self):
        self._made = {}

    def packet(self, topic, payload, qos=0, identifier=0):
        head = self._made.get(topic)
        if head is None:
            name = topic.encode()
            head = self._made[topic] = struct.pack("!H", len(name)) + name
        middle = struct.pack("!HB", identifier, 0) if qos else b"\0"
        left, size = len(head) + len(middle) + len(payload), bytearray()
        while True:
            left, low = left >> 7, left & 0x7F
            size.append(low | (0x80 if left else 0))
            if not left:
                break
        return b"".join((bytes((0x30 | qos << 1,)), size, head, middle, payload))


class PoseMessage(msgspec.Struct):
    ts: float
    x: float
    y: float
    z: float


class JointsPayload(msgspec.Struct):
    ts: float
    names: list[str]
    positions: list[float]


def state(port, robots, rate):
    """Publish, collect and send the state of many robots: four topics each, a send every 20 ms."""
    bus, out, head = session(), bare_client(int(port), "floor"), PublishBuilder()
    encode, latest = msgspec.json.Encoder().encode, {}

    def arrived(sample):
        latest[str(sample.key_expr)] = sample.payload.to_bytes()

    kept = bus.declare_subscriber("cw/**", zenoh.handlers.Callback(arrived, indirect=False))
    channels = ("position", "rotation", "joint_states", "imu")
    publishers = [
        [bus.declare_publisher(f"cw/{twin}/data/{channel}") for channel in channels]
        for twin in robots.split(",")
    ]
    topics, names = {}, [f"joint_{n}" for n in range(12)]
    parts = max(1, round(100 / float(rate)))
    for turn in itertools.count():
        began = time.monotonic()
        now = time.time()
        for position, rotation, joints, imu in publishers[turn % parts :: parts]:
            position.put(encode(PoseMessage(now, turn * 0.01, 2.0, 0.5)))
            rotation.put(encode(PoseMessage(now, 0.9, 0.1, 0.1)))
            joints.put(encode(JointsPayload(now, names, [turn * 0.01] * 12)))
            imu.put(encode(PoseMessage(now, 0.1, 0.2, 9.81)))
        if turn % 2:
            pieces = []
            for key, payload in latest.items():
                topic = topics.get(key) or topics.setdefault(key, topic_of(key))
                pieces.append(head.packet(topic, payload))
            latest.clear()
            out.sendall(b"".join(pieces))
        time.sleep(max(0.0, began + 0.01 - time.monotonic()))
    kept.undeclare()


def relay(port, bus_port, *twins):
    """Relay both ways: a ring and this thread outward at QoS 1, a reader thread inward."""
    bus, out, head = session(connect=bus_port), bare_client(int(port), "floor-out"), PublishBuilder()
    free, topics, identifiers = threading.Semaphore(WINDOW), {}, itertools.cycle(range(1, 0xFFFF))
    threading.Thread(target=_acks, args=(out, free), daemon=True).start()
    threading.Thread(target=_inward, args=(port, bus, twins), daemon=True).start()
    ring = bus.declare_subscriber("cw/*/data/navigate_status", zenoh.handlers.RingChannel(8192))
    while True:
        samples = [ring.recv()]
        while len(samples) < 100 and (sample := ring.try_recv()) is not None:
            samples.append(sample)
        pieces = []
        for sample in samples:
            free.acquire()
            key = str(sample.key_expr)
            topic = topics.get(key) or topics.setdefault(key, topic_of(key))
            pieces.append(head.packet(topic, sample.payload.to_bytes(), 1, next(identifiers)))
        out.sendall(b"".join(pieces))


def _acks(opened, free):
    """Release a slot for each acknowledgement, of four or more bytes. The second is the remaining length."""
    rest = b""
    while data := opened.recv(65536):
        rest += data
        while len(rest) >= 2 and len(rest) >= 2 + rest[1]:
            rest = rest[2 + rest[1] :]
            free.release()


def _inward(port, bus, twins):
    """Put messages from the broker on the bus."""
    opened, decoder, keys = bare_client(int(port), "floor-in"), PacketDecoder(5, 1 << 20), {}
    filters = [mqtt5.TopicFilter(f"cyberwave/twin/{twin}/command", max_qos=mqtt5.QoS(1)) for twin in twins]
    opened.sendall(mqtt5.SubscribePacket(1, filters).write())
    acks = collections.deque()
    while data := opened.recv(65536):
        for packet in decoder.feed(data):
            if not isinstance(packet, mqtt5.PublishPacket):
                continue
            if packet.packet_id:
                acks.append(mqtt5.PubAckPacket(packet.packet_id).write())
            key = keys.get(packet.topic)
            if key is None:
                key = keys[packet.topic] = f"cw/{packet.topic.split('/')[2]}/data/command"
            bus.put(key, packet.payload, express=True)
        if acks:
            opened.sendall(b"".join(acks))
            acks.clear()


if __name__ == "__main__":
    {"state": state, "relay": relay}[sys.argv[1]](*sys.argv[2:])
