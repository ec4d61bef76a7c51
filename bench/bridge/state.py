"""State out, translated and validated: 100 and 1,000 robots with four topics each at 10 Hz, and their cost.

The floor produces, publishes and sends the same amount in the simplest way, without translation and
validation.
"""

import sys
import time

import psutil

from bench.common import cpu_seconds, fleet, line, mosquitto, process, puppets, wait_for
from tests.tools.mqtt import Mqtt

SECONDS = 10.0
LOOKED_AT = 10  # robots whose messages are counted
RATE = 10.0  # Hz of each topic


class MessageCount:
    """Count of the messages received from some robots."""

    def __init__(self):
        self.count = 0

    def took(self, _packet, _now):
        self.count += 1


def measure(pid, port, twins):
    """Return percent of a core, the rate received per topic (Hz), memory (MiB) and threads."""
    received = MessageCount()
    leaves = ("position", "rotation", "joint_states", "imu")
    topics = [f"cyberwave/twin/{twin}/{suffix}" for twin in twins[:LOOKED_AT] for suffix in leaves]
    topics += [f"cyberwave/joint/{twin}/update" for twin in twins[:LOOKED_AT]]
    with Mqtt(port, "subscriber", topics=topics, took=received.took, qos=0):
        wait_for(lambda: received.count > 4 * LOOKED_AT)
        time.sleep(2)
        before, began, count = cpu_seconds(pid), time.monotonic(), received.count
        time.sleep(SECONDS)
        spent = time.monotonic() - began
        percent = 100 * (cpu_seconds(pid) - before) / spent
        process_info = psutil.Process(pid)
        rate = (received.count - count) / spent / 4 / LOOKED_AT
        return percent, rate, process_info.memory_info().rss / 2**20, process_info.num_threads()


def ours(number):
    robots = puppets(number, rate=RATE)
    with mosquitto() as port, fleet(robots, port) as edge:
        edge.all_healthy(number)
        time.sleep(6)  # startup load
        return measure(edge.pid, port, [robot["twin"] for robot in robots])


def floor(number):
    twins = [robot["twin"] for robot in puppets(number)]
    command = (sys.executable, "-m", "bench.bridge.floor", "state")
    with mosquitto() as port, process(*command, str(port), ",".join(twins), str(RATE)) as running:
        return measure(running.pid, port, twins)


def run():
    few, many = (100, 1000)
    mine, bare = {}, {}
    for number in (few, many):
        bare[number], mine[number] = floor(number), ours(number)
    tiny = ours(10)
    for number, aim in ((few, "aim: at most 15 %"), (many, "aim: at most 75 %")):
        cpu, rate, _, _ = mine[number]
        line(f"state out, {number} robots x 4 topics x 10 Hz", f"{cpu:.1f} % ({rate:.1f} Hz)", aim)
        line("  floor", f"{bare[number][0]:.1f} % ({bare[number][1]:.1f} Hz)")
        floor_cpu, floor_rate = bare[number][:2]  # the floor misses its rate too
        line("  a message, against the floor", f"{cpu / rate / (floor_cpu / floor_rate):.2f} x")
    ratio = mine[many][0] / many / (mine[few][0] / few)
    line("CPU of a robot at 1,000 against 100", f"{ratio:.2f} x", "aim: at most 0.6")
    sizes = [tiny[2], mine[few][2], mine[many][2]]
    line(
        "memory at 10 / 100 / 1,000 robots",
        " / ".join(f"{size:.0f}" for size in sizes) + " MiB",
        "aim: at most 80 / 90 / 130",
    )
    threads = [tiny[3], mine[few][3], mine[many][3]]
    line("threads at 10 / 100 / 1,000 robots", " / ".join(map(str, threads)), "aim: the same")
