"""Cost of two ground stations that receive the telemetry of fifty aircraft: command latency and CPU.

The edge of ``bench.mavlink`` runs with and without them at the same time, and the two are commanded in turns:
on a busy computer, two runs differ by more than the effect. The stations only read a socket. They are
separate programs at the lowest priority, as on another computer.
"""

import contextlib
import os
import socket
import sys
import tempfile
import time

from bench.common import fleet, free_port, line, mosquitto, process, quantiles, robot
from bench.latency import Cloud
from bench.mavlink import AIRCRAFT, Arrivals, command, cpu_per_aircraft, swarm

COMMANDS = 1000
WATCHERS = 2

STATION = """
import socket, sys
ear = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
ear.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
ear.bind(("127.0.0.1", int(sys.argv[1])))
read = 0
while True:
    read += len(ear.recv(65535))
    print(read, flush=True)
"""


@contextlib.contextmanager
def stations(number):
    """Run stations; yields, by listening port, the file that each writes to."""
    with contextlib.ExitStack() as stack:
        reads = {}
        for _ in range(number):
            port = free_port(socket.SOCK_DGRAM)
            reads[port] = stack.enter_context(tempfile.TemporaryFile())
            program = ["nice", "-n", "19", sys.executable, "-c", STATION, str(port)]
            stack.enter_context(process(*program, stdout=reads[port]))
        yield reads


class WatchedEdge:
    """A running edge and the client that commands it."""

    def __init__(self, edge, broker, notes, files):
        self.edge, self.cloud, self.notes = edge, Cloud(broker), notes
        self._files = files
        self.taken = []

    def shown(self):
        """Return the bytes that each station has read."""
        return [read_by(each) for each in self._files.values()]


@contextlib.contextmanager
def side(watchers):
    """Run an edge with ``watchers`` stations until its message rates are set."""
    notes, port = Arrivals(), free_port(socket.SOCK_DGRAM)
    with stations(watchers) as files:
        shown = [{"link": f"udpout:127.0.0.1:{each}"} for each in files]
        robots = [
            robot(number, port) | {"failsafes": "ignore", "watchers": shown}
            for number in range(1, AIRCRAFT + 1)
        ]
        with mosquitto() as broker, swarm(port, notes), fleet(robots, broker) as edge:
            edge.all_healthy(AIRCRAFT)
            time.sleep(5)  # message rates are being requested
            yield WatchedEdge(edge, broker, notes, files)


def read_by(file):
    """Return the bytes that a station has read, according to its last line."""
    lines = os.pread(file.fileno(), 1 << 30, 0).split(b"\n")[:-1]
    return int(lines[-1]) if lines else 0


def run():
    """Measure both edges side by side and print the ratios."""
    with side(0) as bare, side(WATCHERS) as watched:
        before, began = watched.shown(), time.monotonic()
        costs = {each: cpu_per_aircraft(each.edge.pid) for each in (bare, watched)}
        for number in range(COMMANDS):
            for each in (bare, watched):
                each.taken.append(command(each.cloud, each.notes, number))
        seconds = time.monotonic() - began
        rates = [(new - old) / seconds for old, new in zip(before, watched.shown(), strict=True)]
    for each, name in ((bare, "no watchers"), (watched, f"{WATCHERS} watchers")):
        p50, p99 = quantiles(each.taken)
        line(f"cloud command to the wire, {name}, p50 / p99", f"{p50 * 1e3:.1f} / {p99 * 1e3:.1f} ms")
        line(f"edge, of one core for each aircraft, {name}", f"{costs[each]:.2f} %")
    ratio = quantiles(watched.taken)[1] / quantiles(bare.taken)[1]
    line("p99 with two watchers against none", f"{ratio:.2f} x", "aim: 1.10 x")
    line("shown to each watcher, at least", f"{min(rates) / 1e3:.0f} kB/s")
