"""Soak test with puppets: random faults of network and workers, guarantees checked, memory watched.

``python -m bench soak`` takes 30 minutes, ``python -m bench soak:MINUTES`` a given time. Programs join the
bus and leave it, connections are reset, workers are killed. Memory growth counts after the first third of the
time.

Then our bridge and the SDK's run side by side through the kills and resets of ``bench/bridge/faults.py``.
"""

import contextlib
import json
import random
import time

import psutil
import zenoh

from bench.bridge import faults
from bench.bridge.faults import PROMISES, settle
from bench.bridge.sides import side
from bench.common import line, mosquitto, puppets
from tests.tools.command_client import CommandClient, executed
from tests.tools.promises import broken
from tests.tools.proxy import TcpProxy

MINUTES = 30.0
SETTLED = 1 / 3  # of the time; what is loaded on first use is in memory by then
WORKERS = ("wing-1", "wing-2", "wing-3")
CHURN = 10.0  # mean seconds between two joins or kills
ROBOTS = 20
SEED = 1
ROUND = 2.0  # s, the longest pause between rounds of commands


def fault(rng, proxy):
    """Inject a random network fault, or none."""
    what = rng.choice(("nothing", "nothing", "reset", "cut", "delay", "blackhole"))
    if what in ("reset", "cut"):
        getattr(proxy, what)()
    elif what == "delay":
        proxy.delay = rng.choice((0.0, 0.05, 0.3))
    elif what == "blackhole":
        proxy.blackhole = True
        time.sleep(rng.uniform(0.1, 3.0))
        proxy.blackhole = False
        proxy.reset()


class Churn:
    """Churn around an edge: programs that join its bus and leave, and workers that are killed."""

    def __init__(self, bus, edge, rng):
        self.joins = self.kills = 0
        self._endpoint = f"tcp/127.0.0.1:{bus}"
        self._edge = edge
        self._rng = rng
        self._next = time.monotonic() + CHURN

    def turn(self):
        """Join or kill once the random interval has passed."""
        if time.monotonic() < self._next:
            return
        self._next = time.monotonic() + self._rng.uniform(0.5, 1.5) * CHURN
        if self._rng.random() < 0.5:
            self._join()
        else:
            self._kill()

    def _join(self):
        """Join the bus, subscribe to everything for a moment, and leave."""
        session = zenoh.open(_client(self._endpoint))
        subscriber = session.declare_subscriber("**", lambda _: None)
        time.sleep(0.2)
        subscriber.undeclare()
        session.close()
        self.joins += 1

    def _kill(self):
        """Kill a random worker, if there is one."""
        workers = [
            each for each in self._edge.children() if "fleet.host.workers.worker_process" in each.cmdline()
        ]
        if workers:
            self._rng.choice(workers).kill()
            self.kills += 1


def _client(endpoint):
    """Return the Zenoh configuration of a program that joins."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    return config


def soak(minutes):
    """Soak our bridge and print the findings."""
    rng = random.Random(SEED)
    with contextlib.ExitStack() as stack:
        port = stack.enter_context(mosquitto())
        proxy = stack.enter_context(TcpProxy(port))
        running = stack.enter_context(
            side("fleet", proxy.port, number=ROBOTS, rate=10.0, heard_at=port, workers=WORKERS)
        )
        names = {robot["name"]: robot["twin"] for robot in puppets(ROBOTS)}
        client = stack.enter_context(contextlib.closing(CommandClient(port, names)))
        edge, began = psutil.Process(running.pid), time.monotonic()
        churn = Churn(running.bus, edge, rng)
        memory = files = 0
        while time.monotonic() < began + minutes * 60:
            if not memory and time.monotonic() > began + SETTLED * minutes * 60:
                memory, files = edge.memory_info().rss, edge.num_fds()
            for name in names:
                client.request(name, rng.choice(("poke", "poke", "lunge")))
                client.drive(rng.choice(list(names)))
            fault(rng, proxy)
            churn.turn()
            time.sleep(rng.uniform(0.1, ROUND))
            client.retry_until_accepted()
        proxy.delay = 0.0
        settle(client)
        events = [*client.events(), *executed(running.journal, client.requests)]
        lived = edge.is_running()
        grown, opened = edge.memory_info().rss - memory, edge.num_fds() - files
    requested = [
        str(request.number)
        for request in client.requests.values()
        if request.sent > 1 or not request.answered
    ]
    velocities = driven(client)
    lines = broken([event for event in events if event.request not in velocities], PROMISES)
    what = f"{minutes:g} min, {len(client.requests)} asks, {len(requested)} of them again: unanswered"
    line(what, str(len(client.unanswered())), "aim: 0")
    line("broken promises", str(len(lines)), "aim: 0")
    for each in lines[:10]:
        print("   ", each)
    line("workers killed, programs joined", f"{churn.kills}, {churn.joins}")
    line("the edge lived through all of it", "yes" if lived else "NO", "aim: yes")
    line("memory, once settled", f"{grown / 2**20:+.1f} MiB", "aim: at most +5")
    line("open files", f"{opened:+d}")


def driven(client):
    """Return the names of the velocity commands, which are superseded by newer ones and never answered."""
    return {str(number) for number, request in client.requests.items() if b"move_forward" in request.payload}


def run(rows=()):
    soak(float(rows[0]) if rows else MINUTES)
    faults.run()
