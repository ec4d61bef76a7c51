"""Adapter for wheeled bases on a serial line."""

from __future__ import annotations

import asyncio
from typing import Any, ClassVar

from fleet import (
    LatestMotion,
    Limits,
    Link,
    LinkLost,
    NotReady,
    Robot,
    Separation,
    TimedOut,
    Velocity,
    command,
    opened_link,
    parse_link_url,
    photograph,
)
from fleet.sim.process import SimProcess
from fleet_ugv.accessories import CameraMount, Lamps
from fleet_ugv.board import Board, Inbox
from fleet_ugv.config import UgvConfig
from fleet_ugv.feedback_reporter import FeedbackReporter
from fleet_ugv.lamp_commands import LampCommands
from fleet_ugv.mount_commands import MountCommands
from fleet_ugv.odometry import POSE, WheelOdometry
from fleet_ugv.sim.rehearsed import simulated_base
from fleet_ugv.sim.spec import spec_of

STANDSTILL = 3.0  # s, of the host's 5 s, that a stop waits until the wheels are seen to stand
SIMULATOR = "fleet_ugv.sim"


def _replayed(config: Any, robot: Robot) -> UgvAdapter:
    """Return the adapter itself for a replay: it reaches nothing but its link."""
    return UgvAdapter(config, robot)


class UgvAdapter(LampCommands, MountCommands):
    """Drives a wheeled base, reports its odometry and battery, and stops it whatever fails."""

    Config = UgvConfig
    limits: ClassVar[Limits] = Limits(speed=1.0, yaw_rate=2.0)
    separation: ClassVar[Separation] = Separation(radius=0.4, braking=1.0, precedence=2)
    combines_keys: ClassVar[bool] = True
    simulation = staticmethod(simulated_base)
    replayed = staticmethod(_replayed)

    def __init__(self, config: UgvConfig, robot: Robot) -> None:
        super().__init__(config, robot)
        if config.base.timeout is not None:
            self.failsafe = f"its firmware stops {config.setting.timeout:g} s after the last velocity"
        self._lamps = Lamps()
        self._mount = CameraMount()
        # Where the robot is outlives its cable.
        self._odometry = WheelOdometry(config.scale, config.base.fastest, robot.state.get(POSE))
        self._link: Link

    async def connect(self) -> None:
        """Open the line; raises LinkLost or LinkRefused."""
        url = await _url(self.config, self.robot)
        inbox = Inbox(self.config, self.robot.clock)
        self._link = await self.robot.enter(opened_link(url, inbox.arrived))
        slot = LatestMotion(self._link, self.robot.clock, baud=parse_link_url(url).baud)
        self._board = Board(
            self.config, self.robot, FeedbackReporter(self.config, self._odometry), inbox, slot
        )
        self._board.begin(self._link)

    async def run(self) -> None:
        """Serve the base until its line falls; raises LinkLost."""
        try:
            await self._link.lost()
        finally:
            self._board.end()
            self.robot.state[POSE] = self._odometry.pose

    def drive(self, velocity: Velocity) -> None:
        """Hold this body velocity; a sideways part is dropped."""
        self._board.drive(velocity)

    async def stop(self, reason: str) -> None:  # noqa: ARG002 - whatever the reason, it stands
        """Stop the wheels and wait until they are seen to stand; raises TimedOut if they are not in time."""
        self.halt()
        if not self._board.serves:
            return
        self._board.stands.clear()  # what was seen before this stop says nothing about a velocity just before
        try:
            async with asyncio.timeout(STANDSTILL):
                await self._board.stands.wait()
        except TimeoutError:
            raise TimedOut(
                f"the wheels were not seen to stand within {STANDSTILL:g} s; "
                f"their last reported speed: {self._board.observer.speed:.2f} m/s",
                hint="stop it by other means",
            ) from None

    def halt(self) -> None:
        """Stop the wheels and the camera mount at once; from any thread."""
        self._board.halt()

    def halt_unheard(self, reason: str) -> bool:  # noqa: ARG002 - every stop is the same
        """Write the stops; raises LinkLost if the line does not take them."""
        if not self._board.halt():
            raise LinkLost(f"{self.config.link} is down")
        return True

    # -- display and queries -------------------------------------------------------------------------

    @command("oled_ctrl", moves=False, safe=True, timeout=2.0)
    async def oled_ctrl(self, *, text: str = "") -> None:
        """Write up to four lines on the display; nothing: its own text again."""
        board = self._board
        board.write(board.codec.display(text.splitlines()))

    @command("battery_check", moves=False, safe=True, timeout=2.0)
    async def battery_check(self) -> None:
        """Report the battery now."""
        observer = self._board.observer
        if observer.voltage is None:
            raise NotReady("the base has not reported its voltage")
        self.robot.report(observer.battery(self.robot.clock.time()))

    @command("get_status", moves=False, safe=True, timeout=2.0)
    async def get_status(self) -> None:
        """Report battery and metrics now."""
        observer = self._board.observer
        if observer.voltage is not None:
            self.robot.report(observer.battery(self.robot.clock.time()))
        self._board.metrics()

    @command("take_photo", moves=False, safe=True, timeout=10.0)
    async def take_photo(self) -> None:
        """Publish a picture of the configured camera."""
        self.robot.report(await photograph(self.config.camera, self.robot.clock))


async def _url(config: UgvConfig, robot: Robot) -> str:
    """Return the link to open; a simulated base is started first."""
    if not config.simulated:
        return config.link
    simulator = await robot.enter(robot.share(SIMULATOR, lambda: SimProcess(SIMULATOR)))
    setting = config.setting
    spec = spec_of(config.link, ticks=setting.ticks, diameter=setting.diameter)
    return await robot.enter(simulator.robot(spec))
