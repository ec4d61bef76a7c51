"""Wheeled robots: setpoint to bytes on the pty, CPU per base, and workers that are killed (SIGKILL).

The bases live in one process, the adapters in another, as edge and robots do.
"""

import asyncio
import contextlib
import logging
import os
import pty
import random
import signal
import statistics
import sys
import tempfile
import threading
import time
import tty
import uuid
from pathlib import Path

import psutil

from fleet import NotReady, Vector3, Velocity
from fleet.clock import SystemClock
from fleet.host.make import make_adapter
from fleet.host.wheel import Wheel
from fleet_ugv import UgvAdapter, UgvConfig
from fleet_ugv.sim.launch import SimProcess
from fleet_ugv.sim.server import SimServer
from fleet_ugv.sim.spec import SimSpec

BASES = 20
SECONDS = 15.0
KILLS = 100
PROFILE = "waveshare-beast"


class BenchRobot:
    """What an adapter is given: the host's own wheel, and nobody who listens."""

    def __init__(self, wheel):
        self.name, self.clock, self.log = "bench", SystemClock(), logging.getLogger("bench")
        self.wheel, self.reports, self.health_now = wheel, 0, None

    def report(self, report):
        self.reports += 1

    def health(self, health):
        self.health_now = health

    def authority_lost(self, reason):
        """Nobody is told."""

    def every(self, seconds, call):
        self.wheel.every(seconds, call, owner=self.name, failed=lambda error: sys.exit(str(error)))

    def share(self, key, make):
        return make()


def adapter_of(url, profile=PROFILE):
    config = UgvConfig(name="bench", twin=uuid.uuid4(), adapter="ugv", profile=profile, link=url)
    return make_adapter(UgvAdapter, config)


async def many():
    """Drive many bases at 20 Hz; measure the CPU of this process."""
    wheel = Wheel(asyncio.get_running_loop())
    wheel.start()
    async with SimProcess() as simulator:
        urls = [(await simulator.ask({"add": SimSpec(PROFILE)}))["url"] for _ in range(BASES)]
        robots = [BenchRobot(wheel) for _ in urls]
        adapters = [adapter_of(url) for url in urls]
        runs = [asyncio.create_task(a.run(r)) for a, r in zip(adapters, robots, strict=True)]
        while not all(robot.health_now and not robot.health_now.cause for robot in robots):
            await asyncio.sleep(0.1)
        me, began = psutil.Process(), time.monotonic()
        before = sum(me.cpu_times()[:2])
        heard = sum(robot.reports for robot in robots)
        while time.monotonic() - began < SECONDS:
            for adapter in adapters:
                adapter.drive(Velocity(Vector3(random.uniform(0.1, 0.3))))
            await asyncio.sleep(0.05)
        spent = time.monotonic() - began
        cpu = (sum(me.cpu_times()[:2]) - before) / spent * 100
        rate = (sum(robot.reports for robot in robots) - heard) / spent / BASES
        print(
            f"  {BASES} bases, setpoints and feedback at 20 Hz: {cpu / BASES:.2f} % of a core each, {rate:.0f} reports/s"
        )
        wheel.stop()
        for run in runs:
            run.cancel()
        await asyncio.gather(*runs, return_exceptions=True)


class Tap:
    """The far end of a pty, read by a thread of its own that notes when a setpoint's bytes come."""

    def __init__(self):
        self.master, self.device = pty.openpty()
        tty.setraw(self.device)
        self.url = f"serial:{os.ttyname(self.device)}?baud=115200"
        self.sent, self.waits, self.lock = {}, [], threading.Lock()
        threading.Thread(target=self._read, daemon=True).start()
        threading.Thread(target=self._speak, daemon=True).start()

    def _read(self):
        rest = b""
        while True:
            *lines, rest = (rest + os.read(self.master, 4096)).split(b"\n")
            now = time.perf_counter()
            for line in lines:
                if b'"T":136' in line:
                    os.write(self.master, line + b"\n")
                asked = self.sent.pop(line, None)
                if asked is not None:
                    self.waits.append(now - asked)

    def _speak(self):
        line = (
            b'{"T":1001,"L":0,"R":0,"gx":0,"gy":0,"gz":0,"ax":0,"ay":0,"az":8192,"odl":0,"odr":0,"v":1190}\n'
        )
        while True:
            os.write(self.master, line)
            time.sleep(0.05)


async def latency():
    """Measure from ``drive`` to the bytes at the far end of the device, all bases at once."""
    wheel = Wheel(asyncio.get_running_loop())
    wheel.start()
    taps = [Tap() for _ in range(BASES)]
    robots = [BenchRobot(wheel) for _ in taps]
    adapters = [adapter_of(tap.url) for tap in taps]
    runs = [asyncio.create_task(a.run(r)) for a, r in zip(adapters, robots, strict=True)]
    while not all(robot.health_now and not robot.health_now.cause for robot in robots):
        await asyncio.sleep(0.1)
    for turn in range(int(SECONDS / 0.05)):
        for tap, adapter in zip(taps, adapters, strict=True):
            speed = 0.1 + turn % 2000 / 10000
            tap.sent[b'{"T":1,"L":%.4f,"R":%.4f}' % (speed, speed)] = time.perf_counter()
            adapter.drive(Velocity(Vector3(speed)))
        await asyncio.sleep(0.05)
    waits = sorted(wait * 1000 for tap in taps for wait in tap.waits)
    p99 = waits[int(len(waits) * 0.99)]
    print(
        f"  setpoint to bytes on the pty, {BASES} bases, {len(waits)} setpoints: p50 {statistics.median(waits):.2f} ms, p99 {p99:.2f} ms"
    )
    wheel.stop()
    for run in runs:
        run.cancel()
    await asyncio.gather(*runs, return_exceptions=True)


def drive_for_ever(url):
    """Drive in a forked child until it is killed."""

    async def drive():
        wheel = Wheel(asyncio.get_running_loop())
        wheel.start()
        adapter = adapter_of(url)
        run = asyncio.create_task(adapter.run(BenchRobot(wheel)))
        while not run.done():
            await asyncio.sleep(0.02)
            with contextlib.suppress(NotReady):
                adapter.drive(Velocity(Vector3(0.3)))

    asyncio.run(drive())


def kills():
    """Kill driving workers at random moments; measure how long the base still drives."""
    late, timeout = [], 0.0
    for number in range(KILLS):
        url_out, url_in = os.pipe()
        child = os.fork()
        if child == 0:
            drive_for_ever(os.read(url_out, 500).decode())
            os._exit(0)

        async def one(child=child, url_in=url_in, number=number):
            with tempfile.TemporaryDirectory() as folder:
                server = SimServer(Path(folder))
                port = server.add(SimSpec(PROFILE, seed=number))
                life = asyncio.create_task(server.run())
                os.write(url_in, port.url.encode())
                while port.board.physics.speeds[0] < 0.2:
                    await asyncio.sleep(0.005)
                await asyncio.sleep(random.uniform(0.0, 0.3))
                os.kill(child, signal.SIGKILL)
                killed = port.now()
                while port.board.halted_at is None:
                    await asyncio.sleep(0.005)
                life.cancel()
                await asyncio.gather(life, return_exceptions=True)
                return port.board.halted_at - killed, port.board.timeout

        try:
            stopped, timeout = asyncio.run(one())
        finally:
            os.waitpid(child, 0)
            os.close(url_in)
            os.close(url_out)
        late.append(stopped)
    print(
        f"  {KILLS} workers killed while driving: stopped after at most {max(late):.3f} s (firmware's time-out {timeout:g} s)"
    )


def run():
    kills()
    asyncio.run(many())
    asyncio.run(latency())
