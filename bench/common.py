"""Helpers of the benchmarks: broker, fleet process, simulated vehicles, measurements and output."""

import contextlib
import json
import os
import signal
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from pathlib import Path

import mqtt5
import psutil

from fleet.bus.settings import MEMORY
from tests.programs import find
from tests.tools.command_client import PUPPETS
from tests.tools.ports import free_ports

NAMESPACE = uuid.UUID("00000000-0000-4000-8000-00000000be7c")


def free_port(kind=socket.SOCK_STREAM):
    return free_ports(1, kind)[0]


def twin_of(name):
    return str(uuid.uuid5(NAMESPACE, name))


@contextlib.contextmanager
def process(*command, stdout=subprocess.DEVNULL, **options):
    """Run a program for the duration of the block, then interrupt it, and kill it after 20 s."""
    running = subprocess.Popen(command, stdout=stdout, stderr=subprocess.DEVNULL, **options)
    try:
        yield running
    finally:
        running.send_signal(signal.SIGINT)
        try:
            running.wait(20)
        except subprocess.TimeoutExpired:
            running.kill()
            running.wait()


@contextlib.contextmanager
def mosquitto(port=0):
    """Run Mosquitto on ``port``, or on a free port if it is 0, without persistence."""
    program = find("mosquitto")
    if program is None:
        sys.exit("mosquitto is missing: python3 run.py test fetches it")
    port = port or free_port()
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "mosquitto.conf"
        config.write_text(
            f"listener {port} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\n"
            "max_queued_messages 0\nmax_inflight_messages 1000\n"
        )
        with process(program, "-c", str(config)):
            wait_for(lambda: socket.create_connection(("127.0.0.1", port), 1).close() is None, (OSError,))
            yield port


def set_realtime(pid=0):
    """Give a single-threaded process, or with 0 this thread alone, real-time priority (SCHED_RR).

    The measuring process and the broker are not part of what is measured, and time that they wait for a
    processor would mask it. Without the permission, the priority stays as it is.
    """
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(pid, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(10))


@contextlib.contextmanager
def without_deep_sleep():
    """Keep idle processors out of deep sleep states, as cyclictest does, if permitted.

    Waking from one takes a quarter of a millisecond on some machines, and the less load there is, the deeper
    the processor sleeps: the cheapest candidate would show the longest latency.
    """
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):
            held = stack.enter_context(Path("/dev/cpu_dma_latency").open("wb", buffering=0))
            held.write(struct.pack("i", 0))  # maximum wake-up latency, microseconds
        yield


def listener(port):
    """Return the child process that listens on ``port``."""
    for each in psutil.Process().children():
        if any(one.laddr.port == port and one.status == "LISTEN" for one in each.net_connections()):
            return each
    sys.exit(f"nobody listens on {port}")


def bare_client(port, name):
    """Return a socket with an open MQTT session. Nothing is read from it in the background."""
    opened = socket.create_connection(("127.0.0.1", port))
    opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    opened.sendall(mqtt5.ConnectPacket(name, clean_start=True, keep_alive=0).write())
    opened.recv(4096)
    return opened


class FleetRun:
    """A running ``fleet run``, with the times at which each robot was first reported healthy."""

    def __init__(self, running, runtime):
        self.runtime = runtime
        self.began = time.monotonic()
        self._supervisor = psutil.Process(running.pid)
        self.healthy_at = {}
        threading.Thread(target=self._read, args=(running.stdout,), daemon=True).start()

    def _read(self, lines):
        for text in lines:
            state = json.loads(text)
            if state["health"] == "ok":
                self.healthy_at.setdefault(state["name"], time.monotonic() - self.began)

    @property
    def pid(self):
        """Process ID of the edge, which its supervisor restarts when it dies."""
        wait_for(self._supervisor.children)
        return self._supervisor.children()[0].pid

    def all_healthy(self, number):
        """Wait until ``number`` robots are healthy, and return the seconds that the first of them took."""
        wait_for(lambda: len(self.healthy_at) >= number)
        return min(self.healthy_at.values())


@contextlib.contextmanager
def fleet(robots, broker, folder=None, **sections):
    """Run ``fleet run`` with these robots. Without a broker there is no cloud connection.

    ``folder`` holds the fleet file and the edge's state, for another run. The sockets and the records of
    started commands are in a memory file system, as they are by default.
    """
    with contextlib.ExitStack() as stack:
        runtime = stack.enter_context(tempfile.TemporaryDirectory(prefix="fb", dir=MEMORY))
        folder = folder or stack.enter_context(tempfile.TemporaryDirectory(prefix="fb"))
        path = Path(folder) / "fleet.yaml"
        cloud = {"cloud": {"host": "127.0.0.1", "port": broker, "tls": False}} if broker else {}
        file = {"edge": {"id": "bench"}, **cloud, "plugins": [str(PUPPETS)], "robots": robots}
        file |= sections
        path.write_text(json.dumps(file))
        command = [sys.executable, "-m", "fleet", "run", str(path), "--json"]
        environment = os.environ | {"FLEET_RUNTIME_DIR": runtime, "XDG_STATE_HOME": folder}
        running = process(*command, stdout=subprocess.PIPE, env=environment)
        yield FleetRun(stack.enter_context(running), runtime)


def puppets(number, **options):
    """Return robots of negligible cost (``tests/tools/plugins/puppet.py``) in the edge's own process."""
    names = [f"puppet-{each}" for each in range(number)]
    return [
        {"name": name, "twin": twin_of(name), "adapter": "puppet", "worker": "main", **options}
        for name in names
    ]


def robot(number, port):
    """Return the fleet file's entry of one drone. All share one UDP port, as on a radio link."""
    return {
        "name": f"drone-{number}",
        "twin": twin_of(f"drone-{number}"),
        "adapter": "mavlink",
        "link": f"udpin:127.0.0.1:{port}",
        "system_id": number,
        "failsafes": "set",
    }


@contextlib.contextmanager
def vehicles(number, *, to, flavour="px4", first_id=1, prompt=False):
    """Run simulated vehicles in a separate process that sends to HOST:PORT.

    They represent a world with processors of its own, so they run at idle priority on the last processor,
    except for those whose answers must be ``prompt``.
    """
    last = str(max(os.sched_getaffinity(0)))
    aside = [] if prompt else ["taskset", "-c", last, "chrt", "--idle", "0"]
    command = [*aside, sys.executable, "-m", "fleet_mavlink.sim"]
    command += ["--flavour", flavour, "--vehicles", str(number)]
    with process(*command, "--to", to, "--ready-after", "0", "--system-id", str(first_id)) as running:
        yield running


def wait_for(holds, ignored=(), within=60.0):
    """Wait until ``holds`` returns a true value, and return it."""
    end = time.monotonic() + within
    while time.monotonic() < end:
        with contextlib.suppress(*ignored):
            value = holds()
            if value:
                return value
        time.sleep(0.05)
    sys.exit("a benchmark waited in vain")


def cpu_seconds(pid):
    """Return the processor time that a process has used, in seconds."""
    times = psutil.Process(pid).cpu_times()
    return times.user + times.system


def quantiles(samples):
    """Return the 50th and the 99th percentile."""
    cuts = statistics.quantiles(samples, n=100)
    return cuts[49], cuts[98]


def line(name, figure, aim=""):
    """Print one measurement."""
    print(f"  {name:<58} {figure:>18}   {aim}", flush=True)
