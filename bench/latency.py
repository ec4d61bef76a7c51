"""From a command in the cloud to bytes on the MAVLink socket: ours, the SDK's bridge, and a bare broker hop.

All three hear the same broker. Ours and the vehicle speak through a relay that notes when a command passes.
The peer is the SDK's ZenohMqttBridge and the smallest adapter: a Zenoh subscriber that packs the command and
sends it. They take turns, so that a noisy moment hurts both.
"""

import json
import socket
import sys
import threading
import time

import paho.mqtt.client as mqtt

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

ROUNDS = 4
EACH = 100  # commands a round
PAUSE = 0.04  # s between commands
DO_SET_HOME = 179  # MAV_CMD
COMMANDS = {75, 76}  # COMMAND_INT, COMMAND_LONG

PEER = """
import json, os, socket, sys, threading
twin, mqtt_port, udp_port, queue, bus, role = sys.argv[1:7]
import zenoh
config = zenoh.Config()
config.insert_json5("scouting/multicast/enabled", "false")
endpoint = json.dumps([f"tcp/127.0.0.1:{bus}"])
config.insert_json5("listen/endpoints", endpoint if role == "adapter" else "[]")
config.insert_json5("connect/endpoints", "[]" if role == "adapter" else endpoint)
session = zenoh.open(config)
if role == "bridge":
    os.environ["CYBERWAVE_BRIDGE_QUEUE_DIR"] = queue
    from cyberwave.zenoh_mqtt.bridge import ZenohMqttBridge
    from cyberwave.zenoh_mqtt.config import BridgeConfig
    bridge = ZenohMqttBridge(
        BridgeConfig(enabled=True, twin_uuids=[twin], inbound_topics=["command"]),
        zenoh_session=session, mqtt_host="127.0.0.1", mqtt_port=int(mqtt_port),
    )
    bridge.start()
else:
    from pymavlink.dialects.v20 import common
    out, to = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), ("127.0.0.1", int(udp_port))
    packer = common.MAVLink(None, srcSystem=245, srcComponent=191)
    def command(sample):
        message = packer.command_int_encode(1, 1, 0, 179, 0, 0, 1, 0, 0, 0, 1, 1, 1)
        out.sendto(message.pack(packer), to)
    subscriber = session.declare_subscriber(f"cw/{twin}/data/command", command)
threading.Event().wait()
"""


class Relay:
    """Passes datagrams between the fleet and a vehicle, and notes when a command to set home passes."""

    def __init__(self):
        self.near = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.near.bind(("127.0.0.1", 0))
        self.far = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.far.bind(("127.0.0.1", 0))
        self.fleet_port = None
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
        length = data[1] + 12 + (13 if data[2] & 1 else 0)
        if data[7] in COMMANDS and data[8] == data[9] == 0 and data[1] >= 30:
            command = int.from_bytes(data[10 + 28 : 10 + 30], "little")
            if command == DO_SET_HOME:
                return True
        data = data[length:]
    return False


class Cloud:
    """The sender of commands."""

    def __init__(self, port):
        self.client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2, protocol=mqtt.MQTTv5)
        self.client.on_socket_open = no_delay
        self.client.connect("127.0.0.1", port)
        self.client.loop_start()
        self.heard = threading.Event()
        self.at = 0.0
        self.client.on_message = self._message
        self.client.subscribe("bench/echo")

    def _message(self, _client, _data, _message):
        self.at = time.monotonic()
        self.heard.set()

    def hop(self):
        """Measure one way through the broker and back to this process."""
        self.heard.clear()
        began = time.monotonic()
        self.client.publish("bench/echo", b"x" * 100)
        self.heard.wait(5)
        return self.at - began

    def command(self, twin, relay):
        """Send a command and return the seconds until its bytes passed; None when they did not in 1 s."""
        relay.passed.clear()
        now = time.time()
        message = {"command": "set_home_here", "source_type": "tele", "data": {}, "timestamp": now}
        began = time.monotonic()
        self.client.publish(f"cyberwave/twin/{twin}/command", json.dumps(message))
        return relay.at - began if relay.passed.wait(1) else None


def no_delay(_client, _data, opened):
    opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def run():
    port, peer_twin = free_port(socket.SOCK_DGRAM), twin_of("peer")
    relay, peer_relay = Relay(), Relay()
    relay.fleet_port = peer_relay.fleet_port = port
    far = relay.far.getsockname()[1]
    ours, theirs, hops = [], [], []
    with mosquitto() as broker, vehicles(1, to=f"127.0.0.1:{far}"), fleet([robot(1, port)], broker) as edge:
        near = str(peer_relay.near.getsockname()[1])
        queue, bus = f"/tmp/fleet-bench-{broker}", str(free_port())
        arguments = (peer_twin, str(broker), near, queue, bus)
        with (
            process(sys.executable, "-c", PEER, *arguments, "adapter"),
            process(sys.executable, "-c", PEER, *arguments, "bridge"),
        ):
            edge.all_well(1)
            cloud = Cloud(broker)
            wait_for(lambda: cloud.command(peer_twin, peer_relay))
            wait_for(lambda: cloud.command(twin_of("drone-1"), relay))
            for _ in range(ROUNDS):
                hops += samples(cloud.hop)
                ours += samples(lambda: cloud.command(twin_of("drone-1"), relay))
                theirs += samples(lambda: cloud.command(peer_twin, peer_relay))
    report(ours, theirs, hops)


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
        line(
            f"cloud command to MAVLink bytes: {name} ({len(taken)})",
            f"{p50 * 1e6:.0f} / {p99 * 1e6:.0f} us",
            "p50 / p99",
        )
    mine, peer, hop = quantiles(ours), quantiles(theirs), quantiles(hops)
    line("p50 against the peer", f"{mine[0] / peer[0]:.2f} x", "aim: at most 0.5")
    line("p99 against the peer", f"{mine[1] / peer[1]:.2f} x", "aim: at most 0.5")
    line("p50 against a bare broker hop", f"{mine[0] / hop[0]:.2f} x")
