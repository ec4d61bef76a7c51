"""The three candidates, each a process between a broker and a bus: our edge, the peer, the floor."""

import contextlib
import itertools
import json
import socket
import sys
import tempfile
import time
from pathlib import Path

from bench.common import cpu_seconds, fleet, free_port, process, puppets, twin_of, wait_for
from tests.tools.mqtt import Mqtt

TWINS = 50
READY = 10**9  # the number of the command that shows a candidate to be ready
SIDES = ("fleet", "peer", "floor")


class Candidate:
    """A running candidate: the process whose CPU counts, its twins, and its adapter's journal."""

    def __init__(self, pid, twins, bus, journal, runtime=""):
        self.pid, self.twins, self.bus, self.journal, self.runtime = pid, twins, bus, journal, runtime

    def executed(self):
        """Return when each numbered command was executed."""
        lines = [json.loads(text) for text in self.journal.read_text().splitlines()]
        return {line["number"]: line["at"] for line in lines if line.get("number")}


@contextlib.contextmanager
def side(name, port, *, number=TWINS, rate=0.0, heard_at=0, workers=(), pose_only=False, **sections):
    """Run a candidate.

    ``rate`` is our robots' own report rate, ``pose_only``: of nothing else; the others are loaded by a source
    instead. ``heard_at`` is the
    broker's own port if ``port`` is a proxy's. ``workers`` are workers of our edge, each with a robot of its
    own. ``sections`` are further sections of our fleet.yaml.
    """
    bus = str(free_port())
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="fb"))
        journal = Path(folder) / "journal"
        journal.touch()
        robots = puppets(number, rate=rate, pose_only=pose_only, journal=str(journal))
        twins = [robot["twin"] for robot in robots]
        if name == "fleet":
            listen = {"bus": {"listen": [f"tcp/127.0.0.1:{bus}"], "insecure": "local"}}
            more = [
                {**robot, "name": each, "twin": twin_of(each), "worker": each}
                for each, robot in zip(workers, robots, strict=False)
            ]
            edge = stack.enter_context(fleet(robots + more, port, folder, **listen, **sections))
            edge.all_healthy(number + len(more))
            time.sleep(6)  # startup load
            yield Candidate(edge.pid, twins, bus, journal, edge.runtime)
            return
        run = (sys.executable, "-m")
        stack.enter_context(process(*run, "bench.bridge.peer", "adapter", bus, str(journal)))
        wait_for(lambda: socket.create_connection(("127.0.0.1", int(bus)), 1).close() is None, (OSError,))
        command = {
            "peer": ("bench.bridge.peer", "bridge", str(port), bus, str(Path(folder) / "queue")),
            "floor": ("bench.bridge.floor", "relay", str(port), bus),
        }[name]
        running = stack.enter_context(process(*run, *command, *twins))
        ready = Candidate(running.pid, twins, bus, journal)
        wait_for(lambda: _poked(ready, heard_at or port))
        yield ready


def _poked(side, port):
    """Send a numbered command through the broker, and return whether it arrived at the adapter."""
    payload = json.dumps({"command": "poke", "source_type": "tele", "data": {"number": READY}}).encode()
    with Mqtt(port, "ready") as sender:
        for twin in side.twins:
            sender.publish(f"cyberwave/twin/{twin}/command", payload, 1)
        time.sleep(0.5)
    return READY in side.executed()


class PublishedCount:
    """Number of messages that a source has published, known once it has ended."""

    def __init__(self):
        self.total = 0


@contextlib.contextmanager
def source(side, rate, pad=0):
    """Publish durable messages on a candidate's bus, each padded by ``pad`` bytes."""
    published = PublishedCount()
    command = (sys.executable, "-m", "bench.bridge.source", side.bus, str(rate), str(pad), *side.twins)
    with tempfile.TemporaryFile("w+") as output:
        with process(*command, stdout=output):
            yield published
        output.seek(0)
        total = output.read()
        if not total:
            sys.exit("the source was killed before it printed how many it has published")
        published.total = int(total)


class DurableReceiver:
    """Subscriber to the durable messages of all twins, and their ages."""

    def __init__(self, port):
        self.ages, self.numbers = [], {}
        self._port = port
        self.mqtt = self._opened()

    def reconnect(self):
        """Connect to a restarted broker."""
        self.mqtt.close()
        self.mqtt = self._opened()

    def lost(self, published):
        """Return how many published messages never arrived, and how many first arrived after a later one."""
        firsts = [list(dict.fromkeys(numbers)) for numbers in self.numbers.values()]
        unordered = sum(later < earlier for each in firsts for earlier, later in itertools.pairwise(each))
        return published.total - sum(map(len, firsts)), unordered

    def wait_until_quiet(self, seconds=3.0, within=60.0):
        """Wait until no message has arrived for ``seconds``."""
        end, count, since = time.monotonic() + within, -1, 0.0
        while time.monotonic() < end:
            if count != len(self.ages):
                count, since = len(self.ages), time.monotonic()
            elif time.monotonic() - since >= seconds:
                return
            time.sleep(0.1)

    def _opened(self):
        topics = [f"cyberwave/twin/+/{suffix}" for suffix in ("navigate/status", "navigate_status")]
        return Mqtt(self._port, "subscriber", topics=topics, took=self._took)

    def _took(self, packet, now):
        number, at = json.loads(packet.payload)["message"].split()[:2]
        self.ages.append(now - float(at))
        self.numbers.setdefault(packet.topic, []).append(int(number))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.mqtt.close()


def carried(name, port, heard_at, *, offered, seconds):
    """Offer durable messages to a candidate.

    Returns the messages received per second, the CPU per message (us), and the ages of the messages.
    """
    with (
        side(name, port, heard_at=heard_at) as running,
        DurableReceiver(heard_at) as receiver,
        source(running, offered),
    ):
        wait_for(lambda: receiver.ages)
        time.sleep(2)
        count, before, began = len(receiver.ages), cpu_seconds(running.pid), time.monotonic()
        time.sleep(seconds)
        spent, used = time.monotonic() - began, cpu_seconds(running.pid) - before
        ages = receiver.ages[count:]
        return len(ages) / spent, used / max(1, len(ages)) * 1e6, ages
