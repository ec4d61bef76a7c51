"""Durable messages during a broker outage in which the edge is killed: losses and recovery.

``SECONDS`` is the short form, ``bridge:outage=60`` the long one. Ten puppets publish 1,000 durable messages a
second. Messages of the killed process's last loop iteration, which no spool can hold, are not counted.
"""

import collections
import contextlib
import itertools
import json
import tempfile
import time

import psutil

from bench.common import fleet, free_port, line, listener, mosquitto, puppets, wait_for
from tests.tools.mqtt import Mqtt

ROBOTS = 10
RATE = 100.0  # durable messages per second and robot
SECONDS = 10.0
STATUS = "cyberwave/twin/+/navigate/status"
POSITION = "cyberwave/twin/+/position"


class ReceivedNumbers:
    """Numbers of the durable messages by robot and edge process, and the age of the first state."""

    def __init__(self):
        self.numbers = collections.defaultdict(list)
        self.first = None  # when the first state arrived, and its age
        self.live = False

    def took(self, packet, now):
        message = json.loads(packet.payload)
        if packet.topic.endswith("/position"):
            self.first = self.first or (now, time.time() - message["timestamp"])
            return
        number, _, life = message["message"].split()
        self.numbers[message["action_id"], life].append(int(number))

    def lost(self):
        """Return the numbers missing below the highest received one, and how many arrived out of order."""
        missing = unordered = 0
        for numbers in self.numbers.values():
            missing += max(numbers) - len(set(numbers))
            firsts = list(dict.fromkeys(numbers))
            unordered += sum(later < earlier for earlier, later in itertools.pairwise(firsts))
        return missing, unordered


def run(seconds=SECONDS):
    port, received = free_port(), ReceivedNumbers()
    robots = puppets(ROBOTS, rate=10, events=RATE)
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="fb"))
        with (
            mosquitto(port),
            Mqtt(port, "subscriber", topics=[STATUS], took=received.took),
            fleet(robots, port, folder) as edge,
        ):
            edge.all_healthy(ROBOTS)
            time.sleep(3)
            memory = psutil.Process(edge.pid).memory_info().rss
            listener(port).kill()
            time.sleep(seconds / 2)
            grown = psutil.Process(edge.pid).memory_info().rss - memory
            psutil.Process(edge.pid).kill()
        edge = stack.enter_context(fleet(robots, port, folder))
        edge.all_healthy(ROBOTS)
        time.sleep(seconds / 2)
        stack.enter_context(mosquitto(port))
        began = time.monotonic()
        stack.enter_context(Mqtt(port, "subscriber", topics=[STATUS, POSITION], took=received.took))
        wait_for(lambda: received.first)
        time.sleep(max(SECONDS, seconds / 2))
        report(received, began, grown, seconds)


def report(received, began, grown, seconds):
    missing, unordered = received.lost()
    came = sum(map(len, received.numbers.values()))
    what = f"broker away for {seconds:g} s, edge killed inside"
    line(f"{what}: durable messages lost", f"{missing} ({came} came)", "aim: 0")
    line("out of order within a topic", str(unordered), "aim: 0")
    at, age = received.first
    line("first state after the broker's return", f"{at - began:.2f} s", "aim: at most 1")
    line("and its age", f"{age:.2f} s", "aim: at most 1")
    line("memory that the outage took", f"{grown / 2**20:+.1f} MiB", "aim: at most +20")
