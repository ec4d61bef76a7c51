"""Fifty aircraft on one edge: processor use of each, and the latency of a command and of a stop of all.

The same traffic (``bench.swarm``) is then read in the same run by our link alone, by mavsdk, and by
pymavlink's ``mavutil.recv_match``. The aircraft run at the lowest priority: real ones have processors of
their own, so the simulated world must yield to the edge.
"""

import contextlib
import os
import socket
import sys
import time

from bench.common import cpu_seconds, fleet, free_port, line, mosquitto, process, quantiles, robot, twin_of
from bench.latency import DO_SET_HOME, Cloud, samples
from fleet.cli.stop import StopAttempts

AIRCRAFT = 50
SECONDS = 8.0
COMMANDS = 300
HOLD = 176  # DO_SET_MODE, to BRAKE
PRICE = "aim: under 1 %"

HUB = """
import asyncio, contextlib, sys
from fleet.clock import SystemClock
from fleet_mavlink.link_hub import open_hub
async def main():
    async with open_hub(["udpin:127.0.0.1:" + sys.argv[1]], SystemClock(), 245, 191) as hub:
        with contextlib.ExitStack() as stack:
            for system in range(1, int(sys.argv[2]) + 1):
                stack.enter_context(hub.vehicle(system))
            await asyncio.Event().wait()
asyncio.run(main())
"""
MAVUTIL = """
import sys
from pymavlink import mavutil
link = mavutil.mavlink_connection("udpin:127.0.0.1:" + sys.argv[1], dialect="all")
while True:
    link.recv_match(blocking=True)
"""
MAVSDK = """
import asyncio, sys
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
async def read(stream):
    async for _ in stream:
        pass
async def main():
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection("udpin://127.0.0.1:" + sys.argv[1])
        await asyncio.sleep(4)
        telemetry = [TelemetryAsync(system) for system in await mavsdk.get_systems()]
        print(len(telemetry), flush=True)
        streams = [s for t in telemetry for s in (t.subscribe_position(), t.subscribe_attitude_euler())]
        await asyncio.gather(*map(read, streams))
asyncio.run(main())
"""


class Arrivals:
    """Arrivals at the aircraft: (monotonic time, system ID, command ID)."""

    def __init__(self):
        self.ear = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.ear.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        self.ear.bind(("127.0.0.1", 0))
        self.port = self.ear.getsockname()[1]

    def first(self, command, systems, within=2.0):
        """Return when ``command`` first reached each of these systems."""
        found, end = {}, time.monotonic() + within
        self.ear.settimeout(within)
        while len(found) < len(systems) and time.monotonic() < end:
            with contextlib.suppress(TimeoutError):
                at, system, command_id = self.ear.recv(100).split()
                if int(command_id) == command and int(system) in systems:
                    found.setdefault(int(system), float(at))
        return found

    def forget(self):
        """Drop all arrivals recorded so far."""
        self.ear.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while True:
                self.ear.recv(100)


def swarm(port, notes):
    """Run the simulated aircraft."""
    command = [sys.executable, "-m", "bench.swarm", str(AIRCRAFT), str(port), str(notes.port)]
    return process("nice", "-n", "19", *command)


def cpu_per_aircraft(pid):
    """Return the processor use of a process per aircraft, in percent of a core."""
    before, began = cpu_seconds(pid), time.monotonic()
    time.sleep(SECONDS)
    return 100 * (cpu_seconds(pid) - before) / (time.monotonic() - began) / AIRCRAFT


def measure_edge():
    """Measure the edge.

    Returns the processor use, then times in seconds: bare broker hops, commands to the wire, and a stop to
    the last aircraft.
    """
    notes, port = Arrivals(), free_port(socket.SOCK_DGRAM)
    robots = [robot(number, port) | {"failsafes": "ignore"} for number in range(1, AIRCRAFT + 1)]
    with mosquitto() as broker, swarm(port, notes), fleet(robots, broker) as edge:
        edge.all_healthy(AIRCRAFT)
        time.sleep(5)  # message rates are being requested
        cost, cloud = cpu_per_aircraft(edge.pid), Cloud(broker)
        hops = samples(cloud.hop)
        return cost, hops, commands(cloud, notes), stop_all(edge, notes)


def commands(cloud, notes):
    """Return the seconds from the publication of each command to its bytes at the aircraft."""
    return [command(cloud, notes, number) for number in range(COMMANDS)]


def command(cloud, notes, number):
    """Send a command to the next aircraft, and return the seconds until its bytes arrive there."""
    system = number % AIRCRAFT + 1
    notes.forget()
    began = cloud.send("set_home_here", twin_of(f"drone-{system}"))
    arrived = notes.first(DO_SET_HOME, {system})
    if not arrived:
        sys.exit(f"drone-{system} did not hear command {number + 1}")
    time.sleep(0.02)
    return arrived[system] - began


def stop_all(edge, notes):
    """Return the seconds from ``fleet stop --all`` to the arrival of HOLD at the last aircraft."""
    os.environ["FLEET_RUNTIME_DIR"] = edge.runtime
    notes.forget()
    began = time.monotonic()
    with StopAttempts(()) as effort:
        effort.stop_local_edges()
        arrived = notes.first(HOLD, set(range(1, AIRCRAFT + 1)))
        effort.end()
    if len(arrived) < AIRCRAFT:
        sys.exit(f"only {len(arrived)} of {AIRCRAFT} aircraft heard the stop")
    return max(arrived.values()) - began


def measure_reader(program):
    """Return the processor use of a program that reads the traffic of all aircraft."""
    notes, port = Arrivals(), free_port(socket.SOCK_DGRAM)
    reader = process(sys.executable, "-c", program, str(port), str(AIRCRAFT))
    with swarm(port, notes), reader as running:
        time.sleep(8)  # mavsdk discovers systems for 4 s
        if running.poll() is not None:
            sys.exit("a reader ended: " + program.splitlines()[1])
        return cpu_per_aircraft(running.pid)


def run():
    """Measure all candidates and print their ratios."""
    cost, hops, taken, stopped = measure_edge()
    readers = {name: measure_reader(each) for name, each in (("our link", HUB), ("mavsdk", MAVSDK))}
    readers["mavutil.recv_match"] = measure_reader(MAVUTIL)
    for name, each, aim in (
        ("bare broker hop", hops, ""),
        ("cloud command to the wire", taken, "p99: 20 ms"),
    ):
        p50, p99 = quantiles(each)
        line(f"{name} ({len(each)}), p50 / p99", f"{p50 * 1e3:.1f} / {p99 * 1e3:.1f} ms", aim)
    line(f"stop of all {AIRCRAFT}, last byte", f"{stopped * 1e3:.1f} ms", "aim: 50 ms")
    line("edge, of one core for each aircraft", f"{cost:.2f} %", PRICE)
    for name, each in readers.items():
        line(f"reading alone, {name}, for each aircraft", f"{each:.2f} %")
    for name in ("mavsdk", "mavutil.recv_match"):
        line(f"reading, our link against {name}", f"{readers['our link'] / readers[name]:.2f} x")
