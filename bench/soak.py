"""A soak: puppets, an asker and a network with faults by chance; promises checked, memory and files watched.

``python -m bench soak`` takes 15 minutes; ``python -m bench soak:MINUTES`` as long as it is told.
Then ours and the SDK's bridge go side by side through the kills and resets of ``bench/bridge/faults.py``.
"""

import contextlib
import random
import time

import psutil

from bench.bridge import faults
from bench.bridge.faults import PROMISES, settle
from bench.bridge.sides import side
from bench.common import line, mosquitto, puppets
from fleet.testing.asker import Asker, executed
from fleet.testing.promises import broken
from fleet.testing.proxy import TcpProxy

MINUTES = 15.0
ROBOTS = 20
SEED = 1
ROUND = 2.0  # s at most between rounds of asks


def fault(chance, proxy):
    """Do something to the network; most of the time nothing."""
    what = chance.choice(("nothing", "nothing", "reset", "cut", "delay", "blackhole"))
    if what in ("reset", "cut"):
        getattr(proxy, what)()
    elif what == "delay":
        proxy.delay = chance.choice((0.0, 0.05, 0.3))
    elif what == "blackhole":
        proxy.blackhole = True
        time.sleep(chance.uniform(0.1, 3.0))
        proxy.blackhole = False
        proxy.reset()


def soak(minutes):
    """Soak ours; print what was found."""
    chance = random.Random(SEED)
    with contextlib.ExitStack() as stack:
        port = stack.enter_context(mosquitto())
        proxy = stack.enter_context(TcpProxy(port))
        running = stack.enter_context(side("fleet", proxy.port, number=ROBOTS, rate=10.0, heard_at=port))
        names = {robot["name"]: robot["twin"] for robot in puppets(ROBOTS)}
        asker = stack.enter_context(contextlib.closing(Asker(port, names)))
        edge, end = psutil.Process(running.pid), time.monotonic() + minutes * 60
        memory, files = edge.memory_info().rss, edge.num_fds()
        while time.monotonic() < end:
            for name in names:
                asker.ask(name, chance.choice(("poke", "poke", "lunge")))
                asker.drive(chance.choice(list(names)))
            fault(chance, proxy)
            time.sleep(chance.uniform(0.1, ROUND))
            asker.insist()
        proxy.delay = 0.0
        settle(asker)
        events = [*asker.events(), *executed(running.journal, asker.asks)]
        grown, opened = edge.memory_info().rss - memory, edge.num_fds() - files
    asked = [str(ask.number) for ask in asker.asks.values() if ask.sent > 1 or not ask.answered]
    velocities = driven(asker)
    lines = broken([event for event in events if event.ask not in velocities], PROMISES)
    what = f"{minutes:g} min, {len(asker.asks)} asks, {len(asked)} of them again: unanswered"
    line(what, str(len(asker.unanswered())), "aim: 0")
    line("broken promises", str(len(lines)), "aim: 0")
    for each in lines[:10]:
        print("   ", each)
    line("memory", f"{grown / 2**20:+.1f} MiB", "aim: at most +20")
    line("open files", f"{opened:+d}")


def driven(asker):
    """Return the names of the velocities: of those the newest wins, and nobody answers them."""
    return {str(number) for number, ask in asker.asks.items() if b"move_forward" in ask.payload}


def run(rows=()):
    soak(float(rows[0]) if rows else MINUTES)
    faults.run()
