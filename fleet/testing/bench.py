"""An adapter under test, connected to its robot as the host connects it, with checks in the background."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any

from fleet.adapter import Adapter
from fleet.host.runtime.loop_monitor import LoopMonitor, LoopSilence
from fleet.model.geometry import Velocity, rotate_to_world, wrap_angle
from fleet.model.health import Level
from fleet.model.report import PoseReport
from fleet.testing.operator import Operator
from fleet.testing.probes import implausible
from fleet.testing.robot import LoopRobot, RecordingRobot, serve

BLOCKS = 0.4  # s for which the event loop may be blocked; the dead-man fires after 0.5 s
POLL_INTERVAL = 0.02  # s between checks of the event loop
ONLINE_WITHIN = 60.0  # s; a simulator may have to start first
STEP = 0.05  # s between checks of the robot
FRESH = 0.5  # s; a robot at rest may report no pose
WINDOW = 0.3  # s over which poses give a velocity: the last step of a coarse counter (1 cm) is no motion
ENDS_WITHIN = 5.0  # s within which the tasks of an attempt must end


class Bench(Operator):
    """A connected adapter and its operator; ``life`` is the task of its attempt."""

    def __init__(self, adapter: Adapter[Any], robot: LoopRobot | RecordingRobot) -> None:
        super().__init__(adapter)
        self.robot = robot
        self.life = asyncio.ensure_future(serve(adapter))

    async def pass_time(self, seconds: float) -> None:
        """Let time pass for the adapter; raises the exception that ended its attempt or a periodic call."""
        if isinstance(self.robot, RecordingRobot):
            for _ in range(3):
                await asyncio.sleep(0)
            self.robot.advance(seconds)
        else:
            await asyncio.sleep(seconds)
            if self.robot.failure is not None:
                raise self.robot.failure
        if self.life.done():
            self.life.result()
            raise AssertionError("its run has ended by itself")

    async def until(self, holds: Callable[[], bool], within: float) -> bool:
        """Let time pass until a condition holds; returns False if it does not within ``within`` s."""
        for _ in range(max(1, round(within / STEP))):
            if holds():
                return True
            await self.pass_time(STEP)
        return holds()

    @property
    def is_online(self) -> bool:
        """True if the adapter is connected and the robot is not offline."""
        healths = self.robot.healths
        return self.robot.is_connected and bool(healths) and healths[-1].level < Level.OFFLINE

    def velocity_by_poses(self) -> Velocity | None:
        """Return the mean body velocity of the last ``WINDOW`` s; None without two poses, the last recent."""
        poses = self.robot.reports_of(PoseReport)
        if len(poses) < 2 or self.robot.clock.time() - poses[-1].stamp > FRESH:
            return None
        new = poses[-1]
        old = next((each for each in reversed(poses) if new.stamp - each.stamp >= WINDOW), poses[0])
        seconds = new.stamp - old.stamp
        if seconds <= 0:
            return None
        moved = rotate_to_world(new.position - old.position, -old.rotation.yaw)
        turned = wrap_angle(new.rotation.yaw - old.rotation.yaw)
        return Velocity(moved.scaled(1 / seconds), turned / seconds)


@contextlib.asynccontextmanager
async def connected(adapter: Adapter[Any], robot: LoopRobot | RecordingRobot) -> AsyncIterator[Bench]:
    """Connect an adapter for the time of a block; raises AssertionError for violations of the contract.

    Violations are a blocked event loop, a task that outlives the attempt, and an impossible report.
    """
    before = asyncio.all_tasks()
    with _unblocked():
        bench = Bench(adapter, robot)
        try:
            yield bench
        finally:
            bench.life.cancel()
            await asyncio.wait({bench.life}, timeout=ENDS_WITHIN)
            if isinstance(robot, LoopRobot):
                robot.close()
        left = asyncio.all_tasks() - before - {asyncio.current_task()}
        if left:
            _, left = await asyncio.wait(left, timeout=STEP)
        assert not left, f"it leaves tasks behind: {', '.join(repr(task.get_coro()) for task in left)}"
    flaws = [flaw for report in robot.reports if (flaw := implausible(report, robot.clock.time()))]
    assert not flaws, f"it reports what cannot be true: {'; '.join(flaws[:3])}"


@contextlib.contextmanager
def _unblocked() -> Iterator[None]:
    """Monitor the running loop from another thread; raises AssertionError with the place where it blocked."""
    loop = asyncio.get_running_loop()
    seen, done, places = LoopMonitor(loop), threading.Event(), set[str]()
    turned = [time.monotonic()]

    def beat() -> None:
        turned[0] = time.monotonic()
        if not done.is_set():
            loop.call_later(POLL_INTERVAL, beat)

    def watch() -> None:
        silence = LoopSilence(POLL_INTERVAL)
        while not done.wait(POLL_INTERVAL):
            silence.update(time.monotonic(), turned[0], seen.cpu(), seen.waited)
            if silence.attributable > BLOCKS:
                places.add(seen.place())

    beat()
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        watcher.join()
    assert not places, f"it blocks the event loop for more than {BLOCKS:g} s, at {', '.join(sorted(places))}"
