"""Skew of the start frames of twenty simulated drones that are started at one instant.

Ten drones are in the edge's own process and ten in a worker. Both reach their vehicles through relays that
record when the first frame of the command passes to each. ``fleet send all set_home_here --at`` and a mission
with ``start: together`` are run repeatedly through the command line. The skew of a round is the time from its
first start frame to its last.
"""

import os
import socket
import struct
import subprocess
import sys
import threading
import time

from bench.common import fleet, free_port, line, quantiles, robot, set_realtime, vehicles, wait_for

DRONES = 20
ROUNDS = 20
AHEAD = 4.0  # s
AIM = 0.05  # s
COMMAND_INT, SET_HOME = 75, 179
SEND = ("send", "all", "set_home_here", "--at", f"+{AHEAD:g}s")
MISSION = {
    "version": 1,
    "roles": {"wing": {"from": "all", "count": DRONES}},
    "steps": [{"id": "go", "start": "together", "do": {"wing": "set_home_here"}}],
}


class StartRelay:
    """Relay of datagrams between vehicles and one edge process; records start frames by system ID."""

    def __init__(self, edge_port):
        self.seen = {}
        self.inner, self.outer = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.outer.bind(("127.0.0.1", 0))
        self.inner.connect(("127.0.0.1", edge_port))
        self.port = self.outer.getsockname()[1]
        self.vehicle = None
        threading.Thread(target=self._in, daemon=True).start()
        threading.Thread(target=self._out, daemon=True).start()

    def _in(self):
        set_realtime()
        while True:
            data, self.vehicle = self.outer.recvfrom(65536)
            try:
                self.inner.send(data)
            except ConnectionRefusedError:  # the edge is not listening yet
                continue

    def _out(self):
        set_realtime()
        while True:
            try:
                data = self.inner.recv(65536)
            except ConnectionRefusedError:
                continue
            self._note(data, time.monotonic())
            if self.vehicle is not None:
                self.outer.sendto(data, self.vehicle)

    def _note(self, data, at):
        while len(data) >= 12 and data[0] == 0xFD:
            size, message = 12 + data[1], int.from_bytes(data[7:10], "little")
            payload = data[10 : 10 + data[1]].ljust(35, b"\0")
            if message == COMMAND_INT and struct.unpack_from("<H", payload, 28)[0] == SET_HOME:
                self.seen.setdefault(payload[30], at)
            data = data[size:]


def run():
    """Measure the skew of both ways to start."""
    ports = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM)
    relays = [StartRelay(port) for port in ports]
    half = DRONES // 2
    robots = [
        robot(number, ports[number > half]) | ({"worker": "wing"} if number > half else {})
        for number in range(1, DRONES + 1)
    ]
    groups = {"all": [each["name"] for each in robots]}
    to = [f"127.0.0.1:{relay.port}" for relay in relays]
    with (
        vehicles(half, to=to[0], prompt=True),
        vehicles(half, to=to[1], first_id=half + 1, prompt=True),
        fleet(robots, None, groups=groups, missions={"go": MISSION}) as running,
    ):
        running.all_healthy(DRONES)
        for what, words in (("send --at", SEND), ("mission", ("mission", "run", "go"))):
            _measure(what, words, relays, running.runtime)


def _measure(what, words, relays, runtime):
    """Measure one way to start."""
    skews, refused = [], 0
    for _ in range(ROUNDS):
        skew = _round(words, relays, runtime)
        skews += [skew] if skew is not None else []
        refused += skew is None
    half_of_them, worst = quantiles(skews)
    line(f"{what}: skew of {DRONES} start frames, p50 of {len(skews)}", f"{half_of_them * 1e3:.1f} ms")
    line(f"{what}: skew, p99", f"{worst * 1e3:.1f} ms", f"(<= {AIM * 1e3:.0f} ms)")
    line(f"{what}: skew, worst", f"{max(skews) * 1e3:.1f} ms")
    line(f"{what}: starts that were refused as a whole", f"{refused}")


def _round(words, relays, runtime):
    """Start all drones once and return the skew (s), or None if the start was refused."""
    for relay in relays:
        relay.seen.clear()
    command = [sys.executable, "-m", "fleet", *words]
    environment = os.environ | {"FLEET_RUNTIME_DIR": runtime}
    done = subprocess.run(command, env=environment, capture_output=True, check=False, text=True, timeout=60)
    seen = [at for relay in relays for at in list(relay.seen.values())]
    if done.returncode and not seen:
        print(done.stderr, file=sys.stderr)
        return None
    wait_for(lambda: sum(len(relay.seen) for relay in relays) == DRONES)
    seen = [at for relay in relays for at in list(relay.seen.values())]
    return max(seen) - min(seen)
