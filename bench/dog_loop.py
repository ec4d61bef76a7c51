"""Body controller in real time against a simulated quadruped in another process.

Measures cycle times, processor time, and what follows when the controller is killed. ``python -m
bench.dog_loop URL SECONDS`` runs one controller that stands up and walks, and prints its cycle times.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import can
import psutil

from bench.common import cpu_seconds, line, quantiles, twin_of
from fleet import Vector3, Velocity
from fleet.clock import SystemClock
from fleet.link.canbus.bus import OpenCanBus
from fleet.model.report import Report
from fleet.testing.robot import RecordingRobot, serve
from fleet_quadruped import QuadrupedAdapter, QuadrupedConfig
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.control.controller import Controller
from fleet_quadruped.control.loop import ControlLoop
from fleet_quadruped.control.orders import Activity, DogState, Order
from fleet_quadruped.drives.cia402.frames import SYNC, TPDO1, CountUnits
from fleet_quadruped.drives.cia402.states import DriveState, state_of
from fleet_quadruped.robot.description import EXAMPLE, load_description

HOGS, HOG_SECONDS = 4, 20
STAND, WALK = 4.0, 10.0  # s
STARTED = 30.0  # s within which a controller must have enabled its drives
DOG = load_description(EXAMPLE)
JOINTS = {TPDO1 + joint.id: (joint, CountUnits(joint)) for joint in DOG.all_joints}


class Timed(Controller):
    """A controller that records when its cycles begin."""

    began = 0.0

    def begin(self, now: float) -> None:
        self.began = time.perf_counter()
        super().begin(now)


class Script:
    """Orders to stand up, walk and leave the loop, and the cycle times measured while walking."""

    def __init__(self, seconds: float) -> None:
        self.begun = time.monotonic()
        self.seconds = seconds
        self.controller: Timed | None = None
        self.took: list[float] = []
        self.state = DogState()

    def order(self) -> Order:
        now = time.monotonic()
        walking = STAND < now - self.begun < self.seconds
        order = Order(until=now + 1.0, alive=now, activity=Activity(1, BodyRequest.STAND), x=0.4 * walking)
        return order if now - self.begun < self.seconds else Order(alive=now, leave=True)

    def put(self, state: DogState) -> None:
        if state.mode == "walking":
            self.took.append(time.perf_counter() - self.controller.began)
            self.state = state


def controller(url: str, seconds: float) -> None:
    clock = SystemClock()
    bus = OpenCanBus("a", url, 1_000_000, clock)
    script = Script(seconds)
    script.controller = Timed(DOG, {"a": bus})
    script.controller.drives.configure()
    script.begun = time.monotonic()
    ControlLoop(script.controller, {"a": bus}, script, clock).run()
    bus.close()
    timing = script.state.timing
    fault = script.controller.body.fault
    figures = {"rate": timing.rate, "overruns": timing.overruns, "incomplete": timing.incomplete}
    took = script.took
    print(
        json.dumps(
            {"took": took, "realtime": timing.realtime, "fault": fault, "x": script.state.x, **figures}
        )
    )


@contextlib.contextmanager
def dog() -> Iterator[tuple[str, int]]:
    """Run a simulated quadruped in a separate process; yields the URL of its bus and its process ID."""
    group = ".".join(str(random.randint(1, 254)) for _ in range(3))
    url = f"can:udp_multicast:239.{group}?port={random.randint(43000, 60000)}"
    command = [sys.executable, "-m", "fleet_quadruped.sim", "--bus", f"a={url}"]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as sim:
        assert sim.stdout.readline() == b"ready\n"
        yield url, sim.pid
        sim.stdin.close()


@contextlib.contextmanager
def hogs(number: int) -> Iterator[None]:
    """Run processes that use as much processor time as they get. Each ends on its own after a while."""
    code = f"import time\nend = time.monotonic() + {HOG_SECONDS}\nwhile time.monotonic() < end: pass"
    running = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(number)]
    try:
        yield
    finally:
        for one in running:
            one.kill()
            one.wait()


def start(url: str, seconds: float) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "bench.dog_loop", url, str(seconds)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)


def cycles(number: int) -> None:
    """Print the cycle times while ``number`` other processes compete for the processor."""
    with dog() as (url, sim), hogs(number), start(url, STAND + WALK) as running:
        time.sleep(STAND + 1)
        before = cpu_seconds(running.pid), cpu_seconds(sim)
        time.sleep(WALK - 3)
        used = [
            100 * (now - then) / (WALK - 3)
            for now, then in zip((cpu_seconds(running.pid), cpu_seconds(sim)), before, strict=True)
        ]
        result = json.loads(running.stdout.readline())
    what = f"{number} hogs, FIFO {'given' if result['realtime'] else 'refused'}"
    if not result["took"]:
        line(f"cycle, {what}", "it never walked", result["fault"])
        return
    half, most = (1000 * each for each in quantiles(result["took"]))
    line(f"cycle (read, body, write), {what}: p50, p99", f"{half:.2f}, {most:.2f} ms", "aim: p99 under 4 ms")
    line(
        "  longest; late cycles; without all answers",
        f"{1000 * max(result['took']):.1f} ms; {result['overruns']}; {result['incomplete']}",
    )
    line("  walked, stopped by", f"{result['x']:.2f} m, {result['fault'] or 'nothing'}")
    line("  processor: controller, simulator (UDP buses)", f"{used[0]:.1f} %, {used[1]:.1f} %")


def kill() -> None:
    """Print how the drives react when the controller is killed in mid-trot."""
    with dog() as (url, _), start(url, 60.0) as running:
        _, _, group, port = url.replace("?port=", ":").split(":")
        with can.Bus(interface="udp_multicast", channel=group, port=int(port), fd=False, hop_limit=0) as bus:
            walks(bus)
            running.send_signal(signal.SIGKILL)
            damped, beyond = watch(bus, time.monotonic())
    if not damped:
        sys.exit("no drive was seen enabled after the controller was killed")
    line(
        "controller killed in mid-trot: drives stop by themselves",
        f"{1000 * damped:.0f} ms",
        "100 ms are set",
    )
    line("  farthest a joint went beyond its limits", f"{max(0.0, beyond):.3f} rad")


def walks(bus: can.BusABC) -> None:
    """Wait until the robot has trotted for a second. It starts to stand up once its drives are enabled."""
    end = time.monotonic() + STARTED
    while time.monotonic() < end:
        message = bus.recv(0.1)
        if message is not None and enabled(message):
            time.sleep(STAND + 1)
            while bus.recv(0) is not None:
                pass  # drop what was received meanwhile
            return
    sys.exit("the dog's drives were never enabled")


def enabled(message: can.Message) -> bool:
    """Return whether a message is the feedback of an enabled drive."""
    if message.arbitration_id not in JOINTS:
        return False
    _, units = JOINTS[message.arbitration_id]
    return state_of(units.unpack(bytes(message.data))[0]) is DriveState.ENABLED


def watch(bus: can.BusABC, killed: float) -> tuple[float, float]:
    """Poll the drives for 2 s after the kill.

    Returns when the last drive was seen enabled, and how far joints exceeded their limits.
    """
    last, beyond, requested = 0.0, -1.0, 0.0
    while (passed := time.monotonic() - killed) < 2.0:
        if passed - requested > 0.01:
            requested = passed
            bus.send(can.Message(arbitration_id=SYNC, is_extended_id=False))
        message = bus.recv(0.005)
        if message is None or message.arbitration_id not in JOINTS:
            continue
        joint, units = JOINTS[message.arbitration_id]
        _, angle, _ = units.unpack(bytes(message.data))
        beyond = max(beyond, joint.low - angle, angle - joint.high)
        if enabled(message):
            last = passed
    return last, beyond


class Live(RecordingRobot):
    """A robot whose scheduled calls run in real time and whose reports are discarded."""

    def __init__(self) -> None:
        super().__init__("dog")
        self.clock = SystemClock()
        self.tasks: list[asyncio.Task[None]] = []
        self.sent = 0

    def report(self, report: Report) -> None:
        self.sent += isinstance(report, Report)

    def every(self, seconds: float, call: object) -> None:
        async def turn() -> None:
            while True:
                await asyncio.sleep(seconds)
                call()

        self.tasks.append(asyncio.create_task(turn()))


async def stack(world: str) -> None:
    """Print the processor use of a walking robot: adapter, and process with control loop and physics."""
    config = QuadrupedConfig(name="dog", twin=twin_of("dog"), adapter="quadruped", link=f"sim:{world}")
    robot = Live()
    adapter = QuadrupedAdapter(config, robot)
    run = asyncio.create_task(serve(adapter))
    await robot.until(lambda: len(robot.healths) > 1)
    async for _ in adapter.stand_up():
        pass
    adapter.drive(Velocity(Vector3(0.5)))
    await asyncio.sleep(1.0)
    before, sent = time.process_time(), robot.sent
    (child,) = psutil.Process().children()
    body = cpu_seconds(child.pid)
    await asyncio.sleep(6.0)
    used = 100 * (time.process_time() - before) / 6, 100 * (cpu_seconds(child.pid) - body) / 6
    line(f"walking dog ({world}): adapter; body process with simulator", f"{used[0]:.1f} %; {used[1]:.1f} %")
    line("  reports a second", f"{(robot.sent - sent) / 6:.0f}")
    for task in [*robot.tasks, run]:
        task.cancel()
    await asyncio.gather(*robot.tasks, run, return_exceptions=True)


def run() -> None:
    print(f"  load of this computer before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores", flush=True)
    for number in (0, HOGS):
        cycles(number)
    kill()
    for world in ("mujoco", "kinematic"):
        asyncio.run(stack(world))


if __name__ == "__main__":
    controller(sys.argv[1], float(sys.argv[2]))
