"""A soak: puppets, an asker and a network with faults by chance; promises checked, memory and files watched.

``python -m bench soak`` takes 15 minutes; ``python -m bench soak:MINUTES`` as long as it is told.
Then the SDK's bridge goes through the same storm of resets, and its results are printed beside ours.
"""

import contextlib
import random
import time

import psutil

from bench.bridge.sides import side
from bench.common import line, mosquitto, puppets
from fleet.testing.asker import Asker, counted, executed
from fleet.testing.journal import Rules, What, broken
from fleet.testing.proxy import TcpProxy

MINUTES = 15.0
ROBOTS = 20
SEED = 1
COMMANDS = Rules(max_age=6.0, gate=What.RECEIVED, replies=False)
ROUND = 2.0  # s at most between rounds of asks
STORM = 100  # commands of the storm that both bridges go through


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


def settle(asker, within=60.0):
    """Ask again until everything is answered."""
    end = time.monotonic() + within
    while asker.unanswered() and time.monotonic() < end:
        time.sleep(0.5)
        asker.insist()


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
    lines = broken([event for event in events if event.ask not in driven(asker)], COMMANDS)
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


def storm(name):
    """Send commands to a side through resets; return how many were done, done twice, and refused aloud."""
    with contextlib.ExitStack() as stack:
        port = stack.enter_context(mosquitto())
        proxy = stack.enter_context(TcpProxy(port))
        running = stack.enter_context(side(name, proxy.port, number=4, heard_at=port))
        names = {f"puppet-{number}": twin for number, twin in enumerate(running.twins)}
        asker = stack.enter_context(contextlib.closing(Asker(port, names)))
        for number in range(STORM):
            asker.ask(f"puppet-{number % 4}")
            if number % 5 == 4:
                proxy.reset()
                if name == "fleet":
                    asker.insist()
            time.sleep(0.1)
        if name == "fleet":
            settle(asker)
        time.sleep(5)
        asks = set(map(str, asker.asks))
        counts = {ask: n for ask, n in counted(executed(running.journal, asker.asks)).items() if ask in asks}
    refused = sum(bool(ask.refusal) for ask in asker.asks.values())
    return len(counts), sum(count > 1 for count in counts.values()), refused


def run(rows=()):
    soak(float(rows[0]) if rows else MINUTES)
    for name in ("fleet", "peer"):
        done, twice, refused = storm(name)
        again = "asked again until answered" if name == "fleet" else "it cannot answer, so asked once"
        what = f"storm of resets, {STORM} commands: {name}, {again}"
        line(what, f"{done} done, {refused} refused, {twice} twice", "aim: all, 0 twice")
