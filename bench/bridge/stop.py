"""A stop on the bus while a telemetry consumer is blocked: time from the put to the robot's halt.

With our edge, a program on the bus reads reports with Zenoh's default callback, takes 10 ms for each of the
thousands per second, and the broker is frozen. The same is measured without either ("unloaded").

The peer is a program that uses Zenoh with its defaults, as the SDK does: reports and stops on one session,
default callbacks, and a slow consumer of reports in the process that must stop.

``python -m bench.bridge.stop slow BUS`` and ``... plain BUS JOURNAL`` are the processes of a run.
"""

import contextlib
import json
import signal
import sys
import tempfile
import threading
import time
from pathlib import Path

import zenoh

from bench.bridge.floor import session
from bench.common import fleet, free_port, line, listener, mosquitto, process, puppets, wait_for
from fleet.bus.bus import join_control
from fleet.bus.settings import BusSettings
from fleet.bus.zenoh_session import ZenohSession

STOPS = 2000
ROBOTS = 50
RATE = 50.0  # Hz of each of a robot's three reports
PAUSE = 0.005  # s between stops; each robot is stopped every 50th time
SLOW = 0.01  # s that the consumer takes for each report
PLAIN_STOPS = 40
FLOOD = 10_000  # reports per second offered to the peer's consumer
STOP_KEY = "fleet/bench/stop"


def slow(bus):
    """Read all reports slowly."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # ends without processing unread reports
    opened = session(connect=bus)
    kept = opened.declare_subscriber("cw/**", lambda _: time.sleep(SLOW))
    threading.Event().wait()
    kept.undeclare()


def plain(bus, journal):
    """Process reports slowly and stops immediately, with the default callbacks of one session."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    out = Path(journal)
    opened = session(listen=bus)

    def stop(sample):
        now = time.monotonic()
        with out.open("a") as file:
            file.write(json.dumps({"robot": json.loads(sample.payload.to_bytes())[0], "at": now}) + "\n")

    kept = [opened.declare_subscriber("cw/**", lambda _: time.sleep(SLOW))]
    kept.append(opened.declare_subscriber(STOP_KEY, stop))
    threading.Event().wait()


class StopClient:
    """A client on the control session of the bus that stops robots, as ``fleet stop`` does."""

    def __init__(self, bus_session):
        self.bus_session = bus_session
        self.requested = []

    def stop(self, robot):
        """Stop one robot."""
        self.requested.append((time.monotonic(), robot))
        self.bus_session.put(STOP_KEY, json.dumps([robot]).encode(), urgent=True)


def taken(requested, lines):
    """Return the latency of each stop (s) that halted its robot before the robot's next stop."""
    halts, until, took = {}, {}, []
    for halt in lines:
        halts.setdefault(halt["robot"], []).append(halt["at"])
    for at, robot in reversed(requested):
        end = until.get(robot, float("inf"))
        until[robot] = at
        took += [halt - at for halt in halts.get(robot, ()) if at <= halt < end][:1]
    return took


def ours(stops, *, loaded):
    """Return the stop latencies, with the consumer blocked and the broker frozen, or with neither."""
    port = free_port()
    with contextlib.ExitStack() as stack:
        journal = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="fb"))) / "journal"
        robots = puppets(ROBOTS, rate=RATE, journal=str(journal))
        broker = stack.enter_context(mosquitto())
        listen = {"listen": [f"tcp/127.0.0.1:{port}"], "insecure": "local"}
        edge = stack.enter_context(fleet(robots, broker, bus=listen))
        edge.all_healthy(ROBOTS)
        time.sleep(3)
        if loaded:
            stack.enter_context(process(sys.executable, "-m", "bench.bridge.stop", "slow", str(port)))
            time.sleep(3)
            stack.enter_context(frozen(broker))
        operator = StopClient(join_control(BusSettings(edge="bench"), Path(edge.runtime)))
        stack.callback(operator.bus_session.close)
        names = [robot["name"] for robot in robots]
        time.sleep(1)
        for number in range(stops):
            operator.stop(names[number % ROBOTS])
            time.sleep(PAUSE)
        time.sleep(1)
        events = [json.loads(text) for text in journal.read_text().splitlines()]
    return taken(operator.requested, [event for event in events if event["what"] == "halt"])


def peers():
    """Return the latencies of the stops that reached a program with Zenoh's defaults."""
    bus = str(free_port())
    with tempfile.NamedTemporaryFile() as journal:
        with process(sys.executable, "-m", "bench.bridge.stop", "plain", bus, journal.name):
            wait_for(lambda: session(connect=bus), (zenoh.ZError,)).close()
            operator = StopClient(
                ZenohSession({"mode": "client", "connect/endpoints": [f"tcp/127.0.0.1:{bus}"]})
            )
            ended = threading.Event()
            flood = threading.Thread(target=_flood, args=(operator.bus_session, ended))
            flood.start()
            time.sleep(3)
            for number in range(PLAIN_STOPS):
                operator.stop(str(number))
                time.sleep(0.05)
            time.sleep(1)
            ended.set()
            flood.join()
            operator.bus_session.close()
        events = [json.loads(text) for text in Path(journal.name).read_text().splitlines()]
    return taken(operator.requested, events)


def _flood(bus_session, ended):
    """Put reports in bursts of 10 ms."""
    while not ended.wait(0.01):
        for number in range(FLOOD // 100):
            bus_session.put(f"cw/{number}/data/position", b"x" * 150)


@contextlib.contextmanager
def frozen(port):
    """Suspend the process that listens on ``port``, our Mosquitto."""
    broker = listener(port)
    broker.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        broker.send_signal(signal.SIGCONT)


def run(stops=STOPS):
    stops = int(stops)
    quiet, busy, plainly = ours(stops, loaded=False), ours(stops, loaded=True), peers()
    what = "stops while a consumer of reports is blocked"
    line(f"{what}: default callbacks", f"{len(plainly)} of {PLAIN_STOPS}")
    line(f"{what}: ours", f"{len(busy)} of {stops}", "aim: all")
    for name, took in (("unloaded", quiet), ("consumer blocked, broker frozen", busy)):
        took.sort()
        p50, tail = took[len(took) // 2] * 1e3, took[int(len(took) * 0.999)] * 1e3
        line(f"p50 / p99.9, {name}", f"{p50:.2f} / {tail:.1f} ms", "aim: p99.9 at most 10")
    ratio = busy[int(len(busy) * 0.999)] / quiet[int(len(quiet) * 0.999)]
    line("p99.9 against unloaded", f"{ratio:.2f} x", "aim: at most 3")


if __name__ == "__main__":
    {"slow": slow, "plain": plain}[sys.argv[1]](*sys.argv[2:])
