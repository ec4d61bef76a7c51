"""Puppet adapter for benchmarks and fault tests: a robot of negligible cost that records its calls.

All puppets append to one journal file, a JSON line with the monotonic time for each event. Each line is a
single write, so the journal survives the death of the process.
"""

from __future__ import annotations

import json
import math
import os
import sys
from typing import Annotated, Literal

from fleet.adapter import Adapter, Robot
from fleet.commands import Range, command
from fleet.model.geometry import Quaternion, Vector3, Velocity
from fleet.model.navigation import ActionState
from fleet.model.report import ImuReport, JointReport, NavigationReport, PoseReport
from fleet.robot_config import AdapterConfig, Limits

_Number = Annotated[int, Range(0, 2**53, "(a number to count by)")]


class PuppetConfig(AdapterConfig):
    """``rate``: pose, joints and IMU a second, or the pose alone. ``events``: durable reports a second.

    ``journal``: a file.
    """

    adapter: Literal["puppet"]
    rate: float = 10.0
    joints: int = 12
    pose_only: bool = False
    events: float = 0.0
    journal: str = ""


class Puppet(Adapter[PuppetConfig]):
    """One puppet."""

    Config = PuppetConfig
    limits = Limits(speed=100.0, yaw_rate=10.0)
    failsafe = "it moves nothing"

    def __init__(self, config: PuppetConfig, robot: Robot) -> None:
        super().__init__(config, robot)
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT
        self._journal = os.open(config.journal, flags, 0o600) if config.journal else -1
        self._turns = self._reports = 0
        self._credit = 0.0
        self._joints = [sys.intern(f"joint_{number}") for number in range(config.joints)]

    async def connect(self) -> None:
        """Begin to report."""
        if self.config.rate:
            self.robot.every(1 / self.config.rate, self._report)
        if self.config.events:
            self.robot.every(0.02, self._tell)

    def _report(self) -> None:
        """Report pose, joints and IMU: four topics in the cloud. Or the pose alone: two."""
        robot = self.robot
        self._turns += 1
        now, angle = robot.clock.time(), self._turns * 0.01
        half = Quaternion(math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))
        robot.report(PoseReport(now, Vector3(math.cos(angle), math.sin(angle), 0.5), half))
        if self.config.pose_only:
            return
        robot.report(JointReport(now, dict.fromkeys(self._joints, angle)))
        robot.report(ImuReport(now, Vector3(0.01, 0.02, angle), Vector3(0.1, 0.2, 9.81)))

    def _tell(self) -> None:
        """Report events, numbered."""
        robot = self.robot
        self._credit += self.config.events * 0.02
        while self._credit >= 1:
            self._credit -= 1
            self._reports += 1
            now = robot.clock.time()
            note = f"{self._reports} {robot.clock.monotonic()} {os.getpid()}"
            robot.report(NavigationReport(now, f"{self.config.name}", ActionState.RUNNING, 1.0, note))

    def _note(self, what: str, **fields: object) -> None:
        """Write a line of the journal."""
        if self._journal >= 0:
            entry = {"robot": self.config.name, "what": what, "at": self.robot.clock.monotonic(), **fields}
            os.write(self._journal, json.dumps(entry).encode() + b"\n")

    def drive(self, velocity: Velocity) -> None:
        """Note a velocity."""
        self._note("drive", x=velocity.linear.x)

    async def stop(self, reason: str) -> None:
        """Note a stop."""
        self._note("stop", why=reason)

    def halt(self) -> None:
        """Note a halt."""
        self._note("halt")

    @command("poke", moves=False)
    async def poke(self, number: _Number) -> None:
        """Do something that can be counted."""
        self._note("poke", number=number)

    @command("lunge")
    async def lunge(self, number: _Number) -> None:
        """Move in a way that can be counted."""
        self._note("lunge", number=number)
