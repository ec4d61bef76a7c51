"""Adapter for replays of recorded frames: decodes them again; controls nothing, sends nothing.

Joints, IMU and battery follow from the frames alone. The pose is leg odometry, which needs the gait, and the
gait depends on the commands: the pose is not compared.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import Any

from fleet import (
    Adapter,
    Address,
    BatteryReport,
    CanFrame,
    ImuReport,
    JointReport,
    Link,
    Robot,
    open_link,
)
from fleet_quadruped.config import QuadrupedConfig
from fleet_quadruped.control.sensors import SensorValues, imu_of
from fleet_quadruped.drives import drives_of
from fleet_quadruped.replay import SilentBus
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import JOINTS

CHANNELS = frozenset({JointReport.channel, ImuReport.channel, BatteryReport.channel})
"""Channels whose reports follow from the frames alone."""
TOLERANCE: Mapping[str, float] = MappingProxyType({"velocity": 0.1})
"""For drives that do not report a speed it is derived from two angles and their time of reception."""
_SLOW = 1.0  # s between two reports of the battery
_FRESH = 5.0  # s; an older battery measurement is not reported


class RecordedDog(Adapter[QuadrupedConfig]):
    """Drives and sensors of a recorded robot; its links are its buses, by name."""

    Config = QuadrupedConfig

    def __init__(self, config: QuadrupedConfig, robot: Robot, dog: DogDescription) -> None:
        super().__init__(config, robot)
        self._dog = dog
        self._drives = drives_of(dog, {name: SilentBus(name) for name in dog.buses})
        self._imu = SensorValues(dog.imu, whole=True) if dog.imu else None
        self._battery = SensorValues(dog.battery) if dog.battery else None
        self._measured: tuple[float, ...] = ()
        self._links: list[Link] = []

    async def connect(self) -> None:
        """Open the recorded buses; raises LinkLost."""
        self._links = [await open_link(name, partial(self._arrived, name)) for name in self._dog.buses]
        self.robot.every(_SLOW, self._report_battery)

    async def run(self) -> None:
        """Wait until a recorded bus is reopened; raises LinkLost."""
        await asyncio.gather(*(link.lost() for link in self._links))

    async def stop(self, reason: str) -> None:
        """Do nothing: nothing moves."""

    def halt(self) -> None:
        """Do nothing: nothing moves."""

    def _arrived(self, bus: str, data: bytes, _address: Address) -> None:
        """Decode a frame and report the measurement that it completes."""
        frame = CanFrame.unpack(data)
        if frame is None:
            return
        now = self.robot.clock.monotonic()
        if self._imu is not None and (bus, frame.id) in self._imu.frames:
            self._imu.handle_frame(frame, now)
            self._report_imu()
        elif self._battery is not None and (bus, frame.id) in self._battery.frames:
            self._battery.handle_frame(frame, now)
        else:
            self._drives.handle_frame(bus, frame, now)
            self._report_joints(now)

    def _report_joints(self, now: float) -> None:
        """Report the joints once all of them have a new measurement."""
        joints = self._drives.feedback(now)
        measured = tuple(now - age for age in joints.ages)
        before = self._measured or (float("-inf"),) * len(measured)
        if not all(at > last for at, last in zip(measured, before, strict=True)):
            return
        self._measured = measured
        self.robot.report(
            JointReport(
                self._epoch + min(measured),
                dict(zip(JOINTS, joints.angles, strict=True)),
                dict(zip(JOINTS, joints.speeds, strict=True)),
                dict(zip(JOINTS, joints.torques, strict=True)),
            )
        )

    def _report_imu(self) -> None:
        """Report the present IMU measurement."""
        imu = imu_of(self._imu.values) if self._imu is not None else None
        if imu is not None:
            self.robot.report(ImuReport(self.robot.clock.time(), imu.gyro, imu.accel))

    def _report_battery(self) -> None:
        """Report the battery if its measurement is recent."""
        battery = self._battery
        if battery is None or battery.age(self.robot.clock.monotonic()) >= _FRESH:
            return
        values: dict[str, Any] = {
            name: battery.values[name] for name in ("percent", "voltage", "current") if name in battery.values
        }
        if values:
            self.robot.report(BatteryReport(self.robot.clock.time(), **values))

    @property
    def _epoch(self) -> float:
        """Unix seconds at monotonic zero."""
        return self.robot.clock.time() - self.robot.clock.monotonic()
