"""Memory under load: an outage of an hour, compressed; and a slow way, beside the peer.

An hour of outage at full load is 3.6 million durable messages, 1,000 a second; here they come as fast as they
are taken, while 50 robots report at 10 Hz besides (``bridge:memory=3600`` is the whole hour). The short form
has so small a file that it is filled, and what is oldest pushed out of it, as the hour does with the default.
"""

import contextlib
import time

import psutil

from bench.bridge.sides import Ears, side, source
from bench.common import free_port, line, listener, mosquitto
from tests.tools.proxy import TcpProxy

THOUSANDS = 150  # messages of the short form
OFFERED = 8000  # messages a second
FILE = 32  # MiB of the short form's spool
HOUR = 3600  # thousands of messages
PAD = 750  # bytes that make a message 1 kB
LOOK = 0.25  # s
ROUND_TRIP = 0.05  # s
SLOW_SECONDS = 20.0
SLOW_RATE = 1000


def rss(pid):
    """Return the memory of a process, MiB."""
    return psutil.Process(pid).memory_info().rss / 2**20


def growth(pid, seconds):
    """Watch a process for so long; return how much its memory grew at most, MiB."""
    before = most = rss(pid)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        time.sleep(LOOK)
        most = max(most, rss(pid))
    return most - before


def outage(thousands):
    """Take the broker away under full load; return MiB grown, and how many messages were said meanwhile."""
    port = free_port()
    size = {} if thousands >= HOUR else {"edge": {"id": "bench", "spool": {"size": FILE}}}
    with contextlib.ExitStack() as stack:
        stack.enter_context(mosquitto(port))
        running = stack.enter_context(side("fleet", port, rate=10.0, **size))
        ears = stack.enter_context(Ears(port))
        with source(running, SLOW_RATE):
            time.sleep(5)  # what it needs to carry this at all is no growth of the outage
        ears.quiet(1.0)
        listener(port).kill()
        with source(running, OFFERED) as said:
            grown = growth(running.pid, thousands * 1000 / OFFERED)
    return grown, said.total


def slow_way(name):
    """Carry 1 kB messages over a slow way; return MiB grown, and how many came a second."""
    with (
        mosquitto() as port,
        TcpProxy(port, delay=ROUND_TRIP / 2) as proxy,
        side(name, proxy.port, heard_at=port) as running,
        Ears(port) as ears,
        source(running, SLOW_RATE, PAD),
    ):
        grown = growth(running.pid, SLOW_SECONDS)
        return grown, len(ears.ages) / SLOW_SECONDS


def run(thousands=THOUSANDS):
    grown, said = outage(thousands)
    what = f"outage at full load, {said} messages ({said / 60_000:.0f} min at 1,000 /s)"
    line(f"{what}: memory", f"{grown:+.1f} MiB", "aim: at most +20")
    for name in ("fleet", "peer"):
        grown, rate = slow_way(name)
        what = (
            f"{ROUND_TRIP * 1e3:.0f} ms there and back, {SLOW_RATE} /s x 1 kB for {SLOW_SECONDS:g} s: {name}"
        )
        line(what, f"{grown:+.1f} MiB", f"{rate:.0f} /s came; aim: at most +10")
