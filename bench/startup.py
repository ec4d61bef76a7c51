"""Startup times, and the processor time of starting."""

import os
import socket
import subprocess
import sys
import time

from bench.common import fleet, free_port, line, mosquitto, robot, vehicles

RUNS = 7


def cpu_of(*command):
    """Return the least processor time of several runs, in milliseconds."""
    best = float("inf")
    for _ in range(RUNS):
        before = os.times()
        subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
        after = os.times()
        used = after.children_user - before.children_user + after.children_system - before.children_system
        best = min(best, used * 1000)
    return best


def run():
    bare = cpu_of(sys.executable, "-c", "pass")
    version = cpu_of(sys.executable, "-m", "fleet", "--version")
    line("bare interpreter, CPU", f"{bare:.0f} ms")
    line("fleet --version, CPU", f"{version:.0f} ms", "aim: under 80 ms")
    port = free_port(socket.SOCK_DGRAM)
    with mosquitto() as broker, vehicles(1, to=f"127.0.0.1:{port}"):
        time.sleep(3)  # the vehicle is up and sends a heartbeat every second, as a real one would
        with fleet([robot(1, port)], broker) as edge:
            line("fleet run to the first robot online", f"{edge.all_healthy(1):.2f} s", "aim: under 2 s")
