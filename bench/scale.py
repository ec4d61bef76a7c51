"""Processor time, memory and threads of the edge with 10 and with 50 drones."""

import socket
import time

import psutil

from bench.common import cpu_seconds, fleet, free_port, line, mosquitto, robot, vehicles

SECONDS = 10.0
SIZES = (10, 50)


def measure(number):
    """Return percent of a core, MiB and threads of an edge with ``number`` drones."""
    port = free_port(socket.SOCK_DGRAM)
    robots = [robot(each, port) for each in range(1, number + 1)]
    with mosquitto() as broker, vehicles(number, to=f"127.0.0.1:{port}"), fleet(robots, broker) as edge:
        edge.all_healthy(number)
        time.sleep(5)  # message rates are being requested
        before, began = cpu_seconds(edge.pid), time.monotonic()
        time.sleep(SECONDS)
        percent = 100 * (cpu_seconds(edge.pid) - before) / (time.monotonic() - began)
        process_info = psutil.Process(edge.pid)
        return percent, process_info.memory_info().rss / 2**20, process_info.num_threads()


def run():
    results = {number: measure(number) for number in SIZES}
    for number, (percent, memory, threads) in results.items():
        aim = "aim: under 30 %" if number == 50 else ""
        line(f"{number} drones at 10 Hz, of one core", f"{percent:.1f} %", aim)
        line(f"{number} drones, of one core for each drone", f"{percent / number:.2f} %")
        line(f"{number} drones, memory", f"{memory:.0f} MiB")
        line(f"{number} drones, threads", str(threads))
    few, many = (results[number] for number in SIZES)
    per_drone = (many[1] - few[1]) / (SIZES[1] - SIZES[0])
    line("memory for each further drone", f"{per_drone * 1024:.0f} KiB")
    line("threads at 50 drones against 10", f"{many[2] / few[2]:.2f} x", "aim: 1")
