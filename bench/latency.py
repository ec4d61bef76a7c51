"""From a command in the cloud to bytes on the MAVLink socket: ours, the SDK's bridge, and a bare broker hop.

Each side is measured under its own telemetry, as it would be at work: ours serves 50 drones that fly through
it, the peer carries as many messages (50 twins, four channels, 10 Hz) from a Zenoh publisher. The peer is the
SDK's ZenohMqttBridge and the smallest adapter: a Zenoh subscriber that packs the command and sends it. The
sides take turns on one broker. A relay notes when the command's bytes pass.
"""

import json
import socket
import sys
import threading
import time

import mqtt5

from bench.common import (
    fleet,
    free_port,
    line,
    mosquitto,
    process,
    quantiles,
    robot,
    twin_of,
    vehicles,
    wait_for,
)

ROUNDS = 1
EACH = 400  # commands a round; a round takes about a minute
PAUSE = 0.01  # s between commands
DRONES = 50
DO_SET_HOME = 179  # MAV_CMD
COMMANDS = {75, 76}  # COMMAND_INT, COMMAND_LONG

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


class Relay:
    """Passes datagrams between the fleet and a vehicle, and notes when a command to set home passes."""

    def __init__(self, fleet_port=0):
        self.near, self.far = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        for each in (self.near, self.far):
            each.bind(("127.0.0.1", 0))
        self.fleet_port = fleet_port
        self.vehicle = None
        self.passed = threading.Event()
        self.at = 0.0
        threading.Thread(target=self._to_vehicle, daemon=True).start()
        threading.Thread(target=self._to_fleet, daemon=True).start()

    def _to_vehicle(self):
        while True:
            data, _ = self.near.recvfrom(65536)
            now = time.monotonic()
            if is_set_home(data):
                self.at = now
                self.passed.set()
            if self.vehicle:
                self.far.sendto(data, self.vehicle)

    def _to_fleet(self):
        while True:
            data, self.vehicle = self.far.recvfrom(65536)
            self.near.sendto(data, ("127.0.0.1", self.fleet_port))


def is_set_home(data):
    """Look for a MAVLink 2 COMMAND_INT or COMMAND_LONG with DO_SET_HOME in a datagram."""
    while len(data) >= 12 and data[0] == 0xFD:
        is_command = data[7] in COMMANDS and data[8] == data[9] == 0 and data[1] >= 30
        if is_command and int.from_bytes(data[38:40], "little") == DO_SET_HOME:
            return True
        data = data[data[1] + 12 + (13 if data[2] & 1 else 0) :]
    return False


class Cloud:
    """A bare MQTT client: its own cost is next to nothing, so that it hides no difference."""

    def __init__(self, port):
        self.out, self.ear = (self._connect(port, name) for name in ("out", "ear"))
        self.ear.sendall(mqtt5.SubscribePacket(1, [mqtt5.TopicFilter("bench/echo")]).write())
        self.ear.recv(4096)

    def _connect(self, port, name):
        opened = socket.create_connection(("127.0.0.1", port))
        opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        opened.sendall(mqtt5.ConnectPacket(f"bench-{name}", clean_start=True).write())
        opened.recv(4096)
        return opened

    def hop(self):
        """Measure one way through the broker and back to this process."""
        packet = mqtt5.PublishPacket("bench/echo", b"x" * 100).write()
        began = time.monotonic()
        self.out.sendall(packet)
        self.ear.recv(4096)
        return time.monotonic() - began

    def send(self, twin, name):
        """Send a command; return the moment before it was sent."""
        message = {"command": name, "source_type": "tele", "data": {}, "timestamp": time.time()}
        topic = f"cyberwave/twin/{twin}/command"
        packet = mqtt5.PublishPacket(topic, json.dumps(message).encode()).write()
        began = time.monotonic()
        self.out.sendall(packet)
        return began

    def command(self, twin, relay):
        """Send a command and return the seconds until its bytes passed; None when they did not in 1 s."""
        relay.passed.clear()
        began = self.send(twin, "set_home_here")
        return relay.at - began if relay.passed.wait(1) else None


def run():
    ours, theirs, hops = [], [], []
    with mosquitto() as broker:
        cloud = Cloud(broker)
        for _ in range(ROUNDS):
            ours += measure_ours(cloud, broker, hops)
            theirs += measure_peer(cloud, broker)
    report(ours, theirs, hops)


def measure_ours(cloud, broker, hops):
    """Measure a fleet of 50 drones; the first of them is commanded, through the relay."""
    port = free_port(socket.SOCK_DGRAM)
    relay = Relay(port)
    robots = [robot(number, port) for number in range(1, DRONES + 1)]
    first = vehicles(1, to=f"127.0.0.1:{relay.far.getsockname()[1]}")
    rest = vehicles(DRONES - 1, to=f"127.0.0.1:{port}", first_id=2)
    with first, rest, fleet(robots, broker) as edge:
        edge.all_well(DRONES)
        wait_for(lambda: cloud.command(twin_of("drone-1"), relay))
        time.sleep(5)  # message rates are being asked for
        hops += samples(cloud.hop)
        return samples(lambda: cloud.command(twin_of("drone-1"), relay))


def measure_peer(cloud, broker):
    """Measure the SDK's bridge with as many messages."""
    relay = Relay()
    twins = [twin_of(f"peer-{number}") for number in range(DRONES)]
    near, queue, bus = str(relay.near.getsockname()[1]), f"/tmp/fleet-bench-{broker}", str(free_port())
    arguments = (str(broker), near, queue, bus)
    adapter = process(sys.executable, "-c", PEER, *arguments, "adapter", *twins)
    bridge = process(sys.executable, "-c", PEER, *arguments, "bridge", *twins)
    with adapter, bridge:
        wait_for(lambda: cloud.command(twins[0], relay))
        time.sleep(5)
        return samples(lambda: cloud.command(twins[0], relay))


def samples(measure):
    """Measure a round."""
    taken = []
    for _ in range(EACH):
        taken.append(measure())
        time.sleep(PAUSE)
    return [each for each in taken if each is not None]


def report(ours, theirs, hops):
    """Print the figures and what they are of each other."""
    for name, taken in (
        ("bare broker hop", hops),
        ("fleet", ours),
        ("SDK bridge and smallest adapter", theirs),
    ):
        p50, p99 = quantiles(taken)
        line(f"{name} ({len(taken)})", f"{p50 * 1e6:.0f} / {p99 * 1e6:.0f} us", "p50 / p99")
    mine, peer, hop = quantiles(ours), quantiles(theirs), quantiles(hops)
    line("p50 against the peer", f"{mine[0] / peer[0]:.2f} x", "aim: at most 0.5")
    line("p99 against the peer", f"{mine[1] / peer[1]:.2f} x", "aim: at most 0.5")
    line("p50 against a bare broker hop", f"{mine[0] / hop[0]:.2f} x", "aim: at most 4")
