"""Memory under load: an hour's outage compressed in time, and a slow link compared with the peer.

An hour's outage at full load is 3.6 million durable messages, 1,000 a second. Here they come as fast as they
are accepted, while 50 robots report at 10 Hz (``bridge:memory=3600`` is the whole hour). The short form has a
spool so small that it fills up and drops its oldest messages, as the hour does with the default size.
"""

import contextlib
import time

import psutil

from bench.bridge.sides import DurableReceiver, side, source
from bench.common import free_port, line, listener, mosquitto
from tests.tools.proxy import TcpProxy

THOUSANDS = 150  # thousands of messages of the short form
OFFERED = 8000  # messages per second
FILE = 32  # MiB, the short form's spool
HOUR = 3600  # thousands of messages
PAD = 750  # bytes that make a message 1 kB long
POLL_INTERVAL = 0.25  # s
ROUND_TRIP = 0.05  # s
SLOW_SECONDS = 20.0
SLOW_RATE = 1000


def rss(pid):
    """Return the resident memory of a process, MiB."""
    return psutil.Process(pid).memory_info().rss / 2**20


def growth(pid, seconds):
    """Return the greatest growth of a process's memory within ``seconds``, MiB."""
    before = most = rss(pid)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        time.sleep(POLL_INTERVAL)
        most = max(most, rss(pid))
    return most - before


def outage(thousands):
    """Take the broker away under full load; return the memory growth (MiB) and the messages published."""
    port = free_port()
    size = {} if thousands >= HOUR else {"edge": {"id": "bench", "spool": {"size": FILE}}}
    with contextlib.ExitStack() as stack:
        stack.enter_context(mosquitto(port))
        running = stack.enter_context(side("fleet", port, rate=10.0, **size))
        receiver = stack.enter_context(DurableReceiver(port))
        with source(running, SLOW_RATE):
            time.sleep(5)  # what the process needs to carry traffic at all does not count as growth
        receiver.wait_until_quiet(1.0)
        listener(port).kill()
        with source(running, OFFERED) as published:
            grown = growth(running.pid, thousands * 1000 / OFFERED)
    return grown, published.total


def slow_link(name):
    """Carry 1 kB messages over a slow link; return the growth (MiB) and the messages received per second."""
    with (
        mosquitto() as port,
        TcpProxy(port, delay=ROUND_TRIP / 2) as proxy,
        side(name, proxy.port, heard_at=port) as running,
        DurableReceiver(port) as receiver,
        source(running, SLOW_RATE, PAD),
    ):
        grown = growth(running.pid, SLOW_SECONDS)
        return grown, len(receiver.ages) / SLOW_SECONDS


def run(thousands=THOUSANDS):
    grown, published = outage(thousands)
    what = f"outage at full load, {published} messages ({published / 60_000:.0f} min at 1,000 /s)"
    line(f"{what}: memory", f"{grown:+.1f} MiB", "aim: at most +20")
    for name in ("fleet", "peer"):
        grown, rate = slow_link(name)
        what = (
            f"{ROUND_TRIP * 1e3:.0f} ms there and back, {SLOW_RATE} /s x 1 kB for {SLOW_SECONDS:g} s: {name}"
        )
        line(what, f"{grown:+.1f} MiB", f"{rate:.0f} /s came; aim: at most +10")
