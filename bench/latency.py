"""Latency from a cloud command to bytes on the MAVLink socket: our edge, the SDK's bridge, a bare broker hop.

Each candidate is measured under its own telemetry load. Ours serves 50 flying drones. The peer carries as
many messages (50 twins, four channels, 10 Hz) from a Zenoh publisher. The peer is the SDK's ZenohMqttBridge
with a minimal adapter: a Zenoh subscriber that packs the command and sends it. Both take turns on one broker,
and the same 50 drones fly during each turn, unheard during the peer's.

The drones run at idle priority on one processor. The broker and the measuring process have real-time
priority, ours asks for it (``edge.realtime``), and no processor enters a deep sleep state. A relay records
when the command's bytes pass. Two commands are measured: ``move``, a velocity as streamed by an operator, and
``set_home_here``, which is executed once and answered.
"""

import contextlib
import itertools
import json
import math
import socket
import struct
import sys
import threading
import time

import mqtt5

from bench.common import (
    bare_client,
    fleet,
    free_port,
    line,
    listener,
    mosquitto,
    process,
    quantiles,
    robot,
    set_realtime,
    twin_of,
    vehicles,
    wait_for,
    without_deep_sleep,
)

ROUNDS = 2
EACH = 400  # commands per round; a round takes over a minute
PAUSE = 0.01  # s between commands, and between hops
DRONES = 50
DO_SET_HOME = 179  # MAV_CMD
COMMAND_INT, COMMAND_ACK, SET_POSITION_TARGET_LOCAL_NED = 75, 77, 84
KINDS = ("move", "set_home_here")

PEER = """
import json, os, socket, sys, threading, time, uuid
mqtt_port, udp_port, queue, bus, role, *twins = sys.argv[1:]
import zenoh
config = zenoh.Config()
config.insert_json5("scouting/multicast/enabled", "false")
endpoint = json.dumps([f"tcp/127.0.0.1:{bus}"])
config.insert_json5("listen/endpoints", endpoint if role == "adapter" else "[]")
config.insert_json5("connect/endpoints", "[]" if role == "adapter" else endpoint)
session = zenoh.open(config)
channels = ["position", "rotation", "metrics", "battery"]
if role == "bridge":
    os.environ["CYBERWAVE_BRIDGE_QUEUE_DIR"] = queue
    from cyberwave.zenoh_mqtt.bridge import ZenohMqttBridge
    from cyberwave.zenoh_mqtt.config import BridgeConfig
    bridge = ZenohMqttBridge(
        BridgeConfig(enabled=True, twin_uuids=twins, inbound_topics=["command"], outbound_channels=channels),
        zenoh_session=session, mqtt_host="127.0.0.1", mqtt_port=int(mqtt_port),
    )
    bridge.start()
    threading.Event().wait()
from pymavlink.dialects.v20 import common
out, to = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), ("127.0.0.1", int(udp_port))
packer = common.MAVLink(None, srcSystem=245, srcComponent=191)
def command(sample):
    asked = json.loads(sample.payload.to_bytes())
    if asked["command"] == "move":
        climb = asked["data"]["linear_z"]
        message = packer.set_position_target_local_ned_encode(
            0, 1, 1, 1, 0b0000011111000111, 0, 0, 0, 0, 0, -climb, 0, 0, 0, 0, 0
        )
    else:
        message = packer.command_int_encode(1, 1, 0, 179, 0, 0, 1, 0, 0, 0, 1, 1, 1)
    out.sendto(message.pack(packer), to)
subscriber = session.declare_subscriber(f"cw/{twins[0]}/data/command", command)
publishers = [session.declare_publisher(f"cw/{twin}/data/{each}") for twin in twins for each in channels]
payload = json.dumps({"ts": time.time(), "x": 1.0, "y": 2.0, "z": 3.0, "pad": "x" * 80}).encode()
turn = 0
while True:
    for publisher in publishers[turn::5]:
        publisher.put(payload)
    turn = (turn + 1) % 5
    time.sleep(0.02)
"""


class CommandRelay:
    """Relay of datagrams between the fleet and a vehicle that records when an expected command passes."""

    def __init__(self, fleet_port=0):
        self.near, self.far = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        for each in (self.near, self.far):
            each.bind(("127.0.0.1", 0))
        self.fleet_port = fleet_port
        self.vehicle = None
        self.passed = threading.Event()
        self.acknowledged = threading.Event()
        self.at = 0.0
        self._waited_for = None
        threading.Thread(target=self._to_vehicle, daemon=True).start()
        threading.Thread(target=self._to_fleet, daemon=True).start()

    def _to_vehicle(self):
        set_realtime()
        while True:
            data, _ = self.near.recvfrom(65536)
            now = time.monotonic()
            if self._waited_for in requested_in(data):
                self.at, self._waited_for = now, None
                self.passed.set()
            if self.vehicle:
                self.far.sendto(data, self.vehicle)

    def wait_for(self, requested):
        """Arm the relay for the command ``requested``, in the form that ``requested_in`` yields."""
        self.passed.clear()
        self.acknowledged.clear()
        self._waited_for = requested

    def _to_fleet(self):
        set_realtime()
        while True:
            data, self.vehicle = self.far.recvfrom(65536)
            self.near.sendto(data, ("127.0.0.1", self.fleet_port))
            if any(number == COMMAND_ACK for number, _ in frames_in(data)):
                self.acknowledged.set()


def frames_in(data):
    """Yield message ID and payload of the MAVLink 2 frames of a datagram."""
    while len(data) >= 12 and data[0] == 0xFD:
        yield int.from_bytes(data[7:10], "little"), data[10 : 10 + data[1]].ljust(53, b"\0")
        data = data[data[1] + 12 + (13 if data[2] & 1 else 0) :]


def requested_in(data):
    """Yield what the frames of a datagram command: a climb rate in mm/s, or the ID of a command."""
    for number, payload in frames_in(data):
        if number == SET_POSITION_TARGET_LOCAL_NED:
            yield "move", round(-1000 * struct.unpack_from("<f", payload, 24)[0])
        elif number == COMMAND_INT:
            yield "set_home_here", int.from_bytes(payload[28:30], "little")


class Cloud:
    """A bare MQTT client, whose own cost is too small to mask a difference."""

    def __init__(self, port):
        self.out, self.ear = (bare_client(port, f"bench-{name}") for name in ("out", "ear"))
        self.ear.sendall(mqtt5.SubscribePacket(1, [mqtt5.TopicFilter("bench/echo")]).write())
        self.ear.recv(4096)
        self._climbs = itertools.cycle([*range(100, 400), *range(-400, -100)])  # mm/s

    def hop(self):
        """Measure the time through the broker and back to this process, in seconds."""
        packet = mqtt5.PublishPacket("bench/echo", b"x" * 100).write()
        began = time.monotonic()
        self.out.sendall(packet)
        self.ear.recv(4096)
        return time.monotonic() - began

    def command(self, kind, twin, relay):
        """Send a command and return the seconds until its bytes pass the relay, or None after 1 s.

        The next one may be sent once the vehicle has acknowledged this one: our edge gives a vehicle one
        command at a time, and would otherwise wait for these drones, which run at idle priority.
        """
        climb = next(self._climbs)
        fields = {"linear_z": climb / 1000} if kind == "move" else {}
        relay.wait_for((kind, climb if kind == "move" else DO_SET_HOME))
        began = self.send(kind, twin, **fields)
        if not relay.passed.wait(1):
            return None
        if kind == "set_home_here":
            relay.acknowledged.wait(5)
        return relay.at - began

    def send(self, name, twin, **fields):
        """Send a command and return the monotonic time."""
        message = {"command": name, "source_type": "tele", "data": fields, "timestamp": time.time()}
        topic = f"cyberwave/twin/{twin}/command"
        packet = mqtt5.PublishPacket(topic, json.dumps(message).encode()).write()
        began = time.monotonic()
        self.out.sendall(packet)
        return began


def run():
    hops = []
    ours, theirs = ({kind: [] for kind in KINDS} for _ in range(2))
    with mosquitto() as broker, without_deep_sleep():
        set_realtime()
        set_realtime(listener(broker).pid)
        cloud = Cloud(broker)
        for _ in range(ROUNDS):
            measure_ours(cloud, broker, ours, hops)
            measure_peer(cloud, broker, theirs)
    line(f"bare broker hop ({len(hops)})", in_us(hops), "p50 / p99")
    for kind in KINDS:
        report(kind, ours[kind], theirs[kind], hops)


def measure_ours(cloud, broker, taken, hops):
    """Measure a fleet of 50 drones. The first one flies and is commanded through the relay."""
    port = free_port(socket.SOCK_DGRAM)
    relay, twin = CommandRelay(port), twin_of("drone-1")
    robots = [robot(number, port) for number in range(1, DRONES + 1)]
    with world(relay, port), fleet(robots, broker, edge={"id": "bench", "realtime": True}) as edge:
        edge.all_healthy(DRONES)
        time.sleep(5)  # message rates are being requested
        cloud.send("takeoff", twin)
        wait_for(lambda: (cloud.command("move", twin, relay) or math.inf) < 0.02)
        measure(cloud, twin, relay, taken)
        hops += samples(cloud.hop)


@contextlib.contextmanager
def world(relay, port):
    """Run the drones: the first behind the relay, the others on ``port``."""
    first = vehicles(1, to=f"127.0.0.1:{relay.far.getsockname()[1]}", prompt=True)
    with first, vehicles(DRONES - 1, to=f"127.0.0.1:{port}", first_id=2):
        yield


def measure_peer(cloud, broker, taken):
    """Measure the SDK's bridge with the same number of messages."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unheard:
        unheard.bind(("127.0.0.1", 0))
        port = unheard.getsockname()[1]
        relay = CommandRelay(port)
        with world(relay, port):
            measure_bridge(cloud, broker, relay, taken)


def measure_bridge(cloud, broker, relay, taken):
    """Measure the two processes of the peer."""
    twins = [twin_of(f"peer-{number}") for number in range(DRONES)]
    near, queue, bus = str(relay.near.getsockname()[1]), f"/tmp/fleet-bench-{broker}", str(free_port())
    arguments = (str(broker), near, queue, bus)
    adapter = process(sys.executable, "-c", PEER, *arguments, "adapter", *twins)
    bridge = process(sys.executable, "-c", PEER, *arguments, "bridge", *twins)
    with adapter, bridge:
        wait_for(lambda: cloud.command("move", twins[0], relay))
        time.sleep(5)
        measure(cloud, twins[0], relay, taken)


def measure(cloud, twin, relay, taken):
    """Measure each kind of command."""
    for kind in KINDS:
        taken[kind] += samples(lambda kind=kind: cloud.command(kind, twin, relay))


def samples(measure):
    """Return the results of one round, without the commands that did not arrive."""
    taken = []
    for _ in range(EACH):
        taken.append(measure())
        time.sleep(PAUSE)
    return [each for each in taken if each is not None]


def in_us(taken):
    """Return the 50th and 99th percentile as text, in microseconds."""
    p50, p99 = quantiles(taken)
    return f"{p50 * 1e6:.0f} / {p99 * 1e6:.0f} us"


def report(kind, ours, theirs, hops):
    """Print the measurements of one kind of command and their ratios."""
    line(f"{kind}: fleet ({len(ours)})", in_us(ours), "p50 / p99")
    line(f"{kind}: SDK bridge and smallest adapter ({len(theirs)})", in_us(theirs), "p50 / p99")
    mine, peer, hop = quantiles(ours), quantiles(theirs), quantiles(hops)
    line(f"{kind}: p50 against the peer", f"{mine[0] / peer[0]:.2f} x", "aim: at most 0.65")
    line(f"{kind}: p99 against the peer", f"{mine[1] / peer[1]:.2f} x", "aim: at most 0.65")
    line(f"{kind}: p50 against a bare broker hop", f"{mine[0] / hop[0]:.2f} x")
