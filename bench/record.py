"""Cost of a recorder: command latency of the edge with and without one, and the processor time of both.

One edge has 20 robots that send 800 reports a second. A cloud command follows about every 10 ms and is timed
to the adapter, as in ``bridge:command``. The modes take turns of some seconds on the same edge, because the
speed of a shared computer varies within a minute. ``off``: no recorder. ``heard``: a program that receives
everything a recorder would, and drops it. ``on``: a recorder.
"""

import contextlib
import json
import os
import random
import statistics
import sys
import tempfile
import time
from pathlib import Path

import mqtt5

from bench.bridge.sides import side
from bench.common import (
    bare_client,
    cpu_seconds,
    line,
    listener,
    mosquitto,
    process,
    quantiles,
    set_realtime,
    wait_for,
    without_deep_sleep,
)

ROBOTS = 20
MESSAGES = 800  # per second, of all robots
CHANNELS = 3  # of a puppet on the bus
TURNS = 6
COMMANDS = 250  # per turn
PAUSE = 0.01  # s
SETTLE = 2.0  # s after a recorder has started
SIDES = ("off", "heard", "on")
RECORDER = ("-m", "fleet", "record", "--into")
LISTENER = """
import pathlib, sys, time
from fleet.bus.edge_buses import EdgeBuses
from fleet.bus.settings import runtime_dir
from fleet.clock import SystemClock
from fleet.record.recorded_keys import published, REPORTS
from fleet.bus import keys
import asyncio
def opened(edge, bus):
    for key in published(edge):
        bus.control.subscribe(key, lambda *_: None)
    for key in (REPORTS, keys.frames(edge, "*")):
        bus.reports.subscribe_batches(key, lambda _: None)
    (pathlib.Path(sys.argv[1]) / "heard.mcap").touch()
edges = EdgeBuses((), runtime_dir(), SystemClock(), only=False, opened=opened, changed=lambda *_: None)
asyncio.run(edges.run())
"""


class ModeResults:
    """Measurements of one mode: command latencies in seconds by turn, and shares of a processor."""

    def __init__(self):
        self.commands, self.edge, self.own = [], [], []

    def p99(self):
        """Return the 99th percentile of each turn."""
        return [quantiles(turn)[1] for turn in self.commands]


@contextlib.contextmanager
def recorder(name, runtime):
    """Run the recorder or listener beside the edge; yields its process ID, or 0 in mode ``off``."""
    with contextlib.ExitStack() as stack:
        own = 0
        if name != "off":
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="fb"))
            program = (*RECORDER, folder) if name == "on" else ("-c", LISTENER, folder)
            environment = os.environ | {"FLEET_RUNTIME_DIR": runtime}
            begun = process(sys.executable, *program, env=environment)
            own = stack.enter_context(begun).pid
            wait_for(lambda: list(Path(folder).glob("*.mcap")))
        time.sleep(SETTLE)
        yield own


def send(sender, twins, numbers):
    """Send commands, and return the time of each."""
    sent = {}
    for number in numbers:
        message = {"command": "poke", "source_type": "tele", "data": {"number": number}}
        payload = json.dumps(message | {"timestamp": time.time()}).encode()
        topic = f"cyberwave/twin/{twins[number % len(twins)]}/command"
        packet = mqtt5.PublishPacket(topic, payload, qos=mqtt5.QoS(1), packet_id=number).write()
        sent[number] = time.monotonic()
        sender.sendall(packet)
        time.sleep(random.uniform(0.5, 1.5) * PAUSE)
    return sent


def measure(taken, running, sender, own, numbers):
    """Measure one turn."""
    pids = {"edge": running.pid, "own": own}
    began, spent = time.monotonic(), {name: cpu_seconds(pid) for name, pid in pids.items() if pid}
    sent = send(sender, running.twins, numbers)
    for name, before in spent.items():
        share = (cpu_seconds(pids[name]) - before) / (time.monotonic() - began)
        getattr(taken, name).append(share)
    time.sleep(0.5)
    arrived = running.executed()
    taken.commands.append([arrived[each] - at for each, at in sent.items() if each in arrived])


def run(sides=SIDES):
    taken = {name: ModeResults() for name in sides}
    with contextlib.ExitStack() as stack:
        port = stack.enter_context(mosquitto())
        rate = MESSAGES / CHANNELS / ROBOTS
        running = stack.enter_context(side("fleet", port, number=ROBOTS, rate=rate))
        sender = stack.enter_context(bare_client(port, "sender"))
        stack.enter_context(without_deep_sleep())
        set_realtime()
        set_realtime(listener(port).pid)
        turns = [name for turn in range(TURNS) for name in (sides if turn % 2 else sides[::-1])]
        for turn, name in enumerate(turns):
            with recorder(name, running.runtime) as own:
                first = 1 + turn * COMMANDS
                measure(taken[name], running, sender, own, range(first, first + COMMANDS))
    report(taken)


def report(taken):
    """Print the measurements."""
    for name, found in taken.items():
        p50, p99 = (each * 1e6 for each in quantiles([one for turn in found.commands for one in turn]))
        spent = f"edge {statistics.mean(found.edge):.1%}"
        spent += f", own {statistics.mean(found.own):.1%} of a processor" if found.own else ""
        line(f"command, {name}", f"{p50:.0f} / {p99:.0f} us", spent)
    floor = taken.pop("off", None)
    for name, found in taken.items() if floor is not None else ():
        ratio = quantiles([one for turn in found.commands for one in turn])
        base = quantiles([one for turn in floor.commands for one in turn])
        line(f"p99 of a command, {name} against off", f"{ratio[1] / base[1]:.2f} x", "aim: at most 1.10")
        middle = statistics.median(found.p99()) / statistics.median(floor.p99())
        line(
            f"the same, medians of {len(found.commands)} turns",
            f"{middle:.2f} x",
            f"p50 {ratio[0] / base[0]:.2f} x",
        )
