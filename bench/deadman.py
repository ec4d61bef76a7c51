"""Lateness of the dead-man stop on a loaded edge, when all driven robots fall silent at once."""

import json
import sys
import tempfile
import time
from pathlib import Path

from bench.common import fleet, line, mosquitto, process, puppets
from tests.tools.mqtt import Mqtt

ROBOTS = 300  # all report at 10 Hz
DRIVEN = 30
ROUNDS = 12
LEASE = 0.5  # s, the default of fleet.yaml
BARE = """
import time
worst = 0.0
while True:
    began = time.monotonic()
    time.sleep(0.005)
    late = time.monotonic() - began - 0.005
    if late > worst:
        worst = late
        print(worst, flush=True)
"""
"""Timer lateness of the machine itself, measured in an otherwise idle process."""


def run():
    with tempfile.NamedTemporaryFile() as journal, tempfile.TemporaryFile() as timer, mosquitto() as broker:
        robots = puppets(ROBOTS, journal=journal.name)
        with fleet(robots, broker) as edge, Mqtt(broker, "operator") as operator:
            edge.all_healthy(ROBOTS)
            with process(sys.executable, "-c", BARE, stdout=timer):
                for _ in range(ROUNDS):
                    drive(operator, robots[:DRIVEN])
                    time.sleep(2 * LEASE)
        late = lateness(Path(journal.name))
        timer.seek(0)
        bare = float(timer.read().split()[-1])
    late.sort()
    p99 = late[int(len(late) * 0.99)]
    what = f"{DRIVEN} of {ROBOTS} robots fall silent at once, {ROUNDS} times"
    line(f"{what}: stops seen", f"{len(late)} of {DRIVEN * ROUNDS}", f"aim: {DRIVEN * ROUNDS}")
    line(
        "how late, p50 / p99", f"{late[len(late) // 2] * 1e3:.0f} / {p99 * 1e3:.0f} ms", "aim: p99 at most 50"
    )
    line("how late, at most", f"{late[-1] * 1e3:.0f} ms", "aim: 100")
    line("a bare timer in the same time, at most", f"{bare * 1e3:.0f} ms")


def drive(operator, robots):
    """Send robots velocities for one second at 10 Hz."""
    for _ in range(10):
        message = {"command": "move_forward", "source_type": "tele", "data": {"linear_x": 1.0}}
        payload = json.dumps(message | {"timestamp": time.time()}).encode()
        operator.send(
            b"".join(operator.packet(f"cyberwave/twin/{each['twin']}/command", payload) for each in robots)
        )
        time.sleep(0.1)


def lateness(journal):
    """Return, for every halt, its delay after the lease of the last velocity expired."""
    driven, late = {}, []
    for text in journal.read_text().splitlines():
        event = json.loads(text)
        if event["what"] == "drive" and event["x"]:
            driven[event["robot"]] = event["at"]
        elif event["what"] == "halt" and event["robot"] in driven:
            late.append(event["at"] - driven.pop(event["robot"]) - LEASE)
    return late
