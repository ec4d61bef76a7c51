"""Wheeled robots: latency from setpoint to pty, CPU per base, unplugged cables, workers killed (SIGKILL).

The bases run in one process and the adapters in another, as robots and edge do.
"""

import asyncio
import contextlib
import json
import os
import pty
import random
import select
import signal
import statistics
import sys
import tempfile
import time
import tty
import uuid
from pathlib import Path

import psutil

from fleet import LinkLost, NotReady, Vector3, Velocity
from fleet.clock import SystemClock
from fleet.host.robot.adapter_factory import create_adapter
from fleet.host.runtime.tick_scheduler import TickScheduler
from fleet.sim.process import SimProcess
from fleet.testing.robot import RecordingRobot, serve
from fleet_ugv import UgvAdapter, UgvConfig
from fleet_ugv.sim.server import Bases
from fleet_ugv.sim.spec import BaseSpec

BASES = 20
SECONDS = 15.0
KILLS = 100
PULLS = 10
LAST = 0.5  # m/s; the setpoint that ends the measurement
PROFILE = "waveshare-beast"


class BenchRobot(RecordingRobot):
    """Host of an adapter with the real scheduler's timers; keeps the last health, and only counts reports."""

    def __init__(self, scheduler):
        super().__init__("bench", SystemClock())
        self.scheduler, self.count = scheduler, 0

    def report(self, _report):
        self.count += 1

    def health(self, health):
        self.healths[:] = [health]

    def every(self, seconds, call):
        self.scheduler.every(seconds, call, owner=self.name, failed=self.failed)

    def failed(self, error):
        """Ignore the loss of the link, which is expected here; end the benchmark on any other error."""
        if not isinstance(error, LinkLost):
            sys.exit(str(error))


def adapter_of(url, robot, profile=PROFILE):
    config = UgvConfig(name="bench", twin=uuid.uuid4(), adapter="ugv", profile=profile, link=url)
    return create_adapter(UgvAdapter, config, robot)


async def many():
    """Drive many bases at 20 Hz and measure the CPU of this process."""
    scheduler = TickScheduler(asyncio.get_running_loop(), SystemClock())
    scheduler.start()
    async with SimProcess("fleet_ugv.sim") as simulator:
        urls = [(await simulator.request({"add": BaseSpec(PROFILE)}))["url"] for _ in range(BASES)]
        robots = [BenchRobot(scheduler) for _ in urls]
        adapters = [adapter_of(url, robot) for url, robot in zip(urls, robots, strict=True)]
        runs = [asyncio.create_task(serve(each)) for each in adapters]
        await until(lambda: all(is_well(robot) for robot in robots))
        me, began = psutil.Process(), time.monotonic()
        before = sum(me.cpu_times()[:2])
        received = sum(robot.count for robot in robots)
        while time.monotonic() - began < SECONDS:
            for adapter in adapters:
                adapter.drive(Velocity(Vector3(random.uniform(0.1, 0.3))))
            await asyncio.sleep(0.05)
        spent = time.monotonic() - began
        cpu = (sum(me.cpu_times()[:2]) - before) / spent * 100
        rate = (sum(robot.count for robot in robots) - received) / spent / BASES
        print(
            f"  {BASES} bases, setpoints and feedback at 20 Hz: "
            f"{cpu / BASES:.2f} % of a core each, {rate:.0f} reports/s"
        )
        scheduler.stop()
        for run in runs:
            run.cancel()
        await asyncio.gather(*runs, return_exceptions=True)


FEEDBACK = b'{"T":1001,"L":0,"R":0,"gx":0,"gy":0,"gz":0,"ax":0,"ay":0,"az":8192,"odl":0,"odr":0,"v":1190}\n'


def tap(masters, write_fd):
    """Act as the boards in a separate process: record when each line arrives; finally write all records."""
    received, rests, spoken, parent = [], dict.fromkeys(masters, b""), 0.0, os.getppid()
    while os.getppid() == parent:
        for master in select.select(masters, [], [], 0.01)[0]:
            *lines, rests[master] = (rests[master] + os.read(master, 4096)).split(b"\n")
            now = time.perf_counter()
            for line in lines:
                if b'"T":136' in line:
                    os.write(master, line + b"\n")
                received.append((masters.index(master), line.decode(), now))
                if b"%.4f" % LAST in line:
                    os.write(write_fd, json.dumps(received).encode())
                    return
        if time.monotonic() - spoken > 0.05:
            spoken = time.monotonic()
            for master in masters:
                os.write(master, FEEDBACK)


async def latency():
    """Measure from ``drive`` to the bytes at the far end of the device, on all bases at once."""
    pairs = [pty.openpty() for _ in range(BASES)]
    for _, device in pairs:
        tty.setraw(device)
    read_fd, write_fd = os.pipe()
    child = os.fork()
    if child == 0:
        tap([master for master, _ in pairs], write_fd)
        os._exit(0)
    os.close(write_fd)
    scheduler = TickScheduler(asyncio.get_running_loop(), SystemClock())
    scheduler.start()
    robots = [BenchRobot(scheduler) for _ in pairs]
    adapters = [
        adapter_of(f"serial:{os.ttyname(device)}?baud=115200", robot)
        for (_, device), robot in zip(pairs, robots, strict=True)
    ]
    runs = [asyncio.create_task(serve(each)) for each in adapters]
    await until(lambda: all(is_well(robot) for robot in robots))
    sent = {}
    for turn in range(int(SECONDS / 0.05)):
        speed = 0.1 + turn / 5000
        for number, adapter in enumerate(adapters):
            sent[number, f'{{"T":1,"L":{speed:.4f},"R":{speed:.4f}}}'] = time.perf_counter()
            adapter.drive(Velocity(Vector3(speed)))
        await asyncio.sleep(0.05)
    adapters[0].drive(Velocity(Vector3(LAST)))
    waits = await asyncio.to_thread(waits_of, read_fd, sent)
    print(
        f"  setpoint to bytes on the pty, {BASES} bases, {len(waits)} setpoints: "
        f"p50 {statistics.median(waits):.2f} ms, p99 {waits[int(len(waits) * 0.99)]:.2f} ms"
    )
    await asyncio.to_thread(os.waitpid, child, 0)
    scheduler.stop()
    for run in runs:
        run.cancel()
    await asyncio.gather(*runs, return_exceptions=True)


def waits_of(read_fd, sent):
    """Return the latency of each setpoint in ms, sorted."""
    with os.fdopen(read_fd, "rb") as pipe:
        received = json.loads(pipe.read())
    waits = []
    for number, line, at in received:
        requested = sent.pop((number, line), None)
        if requested is not None:
            waits.append((at - requested) * 1000)
    return sorted(waits)


async def until(condition):
    """Wait until a condition holds."""
    while not condition():  # noqa: ASYNC110 - there is no event to wait for
        await asyncio.sleep(0.005)


def is_well(robot):
    """Return whether a base is ready."""
    return bool(robot.healths) and not robot.healths[-1].cause


async def unplugs():
    """Unplug cables and measure the time until the adapter's run has ended."""
    waits = []
    scheduler = TickScheduler(asyncio.get_running_loop(), SystemClock())
    scheduler.start()
    with tempfile.TemporaryDirectory() as folder:
        server = Bases(Path(folder))
        life = asyncio.create_task(server.run())
        for _ in range(PULLS):
            port = await server.add(BaseSpec(PROFILE))
            robot = BenchRobot(scheduler)
            run = asyncio.create_task(serve(adapter_of(port.url, robot)))
            await until(lambda robot=robot: is_well(robot))
            pulled = time.perf_counter()
            port.unplug()
            await asyncio.wait({run})
            waits.append((time.perf_counter() - pulled) * 1000)
            with contextlib.suppress(LinkLost):
                run.result()
        life.cancel()
        await asyncio.gather(life, return_exceptions=True)
    scheduler.stop()
    print(f"  {PULLS} cables pulled: noticed after at most {max(waits):.1f} ms")


def drive_for_ever(url):
    """Drive until killed. Runs in a forked child."""

    async def drive():
        scheduler = TickScheduler(asyncio.get_running_loop(), SystemClock())
        scheduler.start()
        adapter = adapter_of(url, robot := BenchRobot(scheduler))
        run = asyncio.create_task(serve(adapter))
        while not run.done():
            await asyncio.sleep(0.02)
            with contextlib.suppress(NotReady):
                if robot.is_connected:
                    adapter.drive(Velocity(Vector3(0.3)))

    asyncio.run(drive())


def kills():
    """Kill driving workers at random moments and measure how long the base keeps moving."""
    late, timeout = [], 0.0
    for number in range(KILLS):
        url_out, url_in = os.pipe()
        child = os.fork()
        if child == 0:
            drive_for_ever(os.read(url_out, 500).decode())
            os._exit(0)

        async def one(child=child, url_in=url_in, number=number):
            with tempfile.TemporaryDirectory() as folder:
                server = Bases(Path(folder))
                port = await server.add(BaseSpec(PROFILE, seed=number))
                life = asyncio.create_task(server.run())
                os.write(url_in, port.url.encode())
                await until(lambda: port.board.physics.speeds[0] > 0.2)
                await asyncio.sleep(random.uniform(0.0, 0.3))
                os.kill(child, signal.SIGKILL)
                killed = port.now()
                await until(lambda: port.board.halted_at is not None)
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
        f"  {KILLS} workers killed while driving: "
        f"stopped after at most {max(late):.3f} s (firmware's time-out {timeout:g} s)"
    )


def run():
    kills()
    asyncio.run(unplugs())
    asyncio.run(many())
    asyncio.run(latency())
