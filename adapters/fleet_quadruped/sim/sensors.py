"""Simulated IMU and battery: their frames, and their faults by name."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Mapping
from types import MappingProxyType

from fleet import CanFrame, Quaternion
from fleet_quadruped.body.measured import MeasuredImu
from fleet_quadruped.frames import FrameEncoder
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.parts import Sensor
from fleet_quadruped.sim.world import World

SENSOR_FAULTS: Mapping[str, str] = MappingProxyType(
    {
        "imu": "the IMU is silent",
        "frozen": "the IMU's values are frozen",
        "upside": "the IMU is mounted upside down",
        "bms": "the battery is silent",
        "battery": "battery percentage",
    }
)
_BATTERY_EVERY = 1.0  # s
_NOISE = 0.02  # m/s2: a real IMU never repeats a value
FULL, _PERCENT = 48.0, 80.0  # V; of the battery


class Sensors:
    """Sensors of a robot. ``faults``: the active faults, with their values."""

    def __init__(self, dog: DogDescription, world: World) -> None:
        self.faults: dict[str, float] = {}
        self.voltage = FULL
        self._world = world
        self._next_battery = 0.0
        self._imu_frames, self._battery_frames = _encoders(dog.imu), _encoders(dog.battery)
        self._frozen: MeasuredImu | None = None
        self._rng = random.Random(1)  # noqa: S311 - reproducible

    def frames(self, now: float) -> Iterator[tuple[str, CanFrame]]:
        """Yield (bus, frame) for the values due at ``now``."""
        if self._imu_frames and "imu" not in self.faults:
            values = self._imu()
            for bus, number, encoder in self._imu_frames:
                yield bus, CanFrame(number, encoder.encode(values))
        if now >= self._next_battery and "bms" not in self.faults:
            self._next_battery = now + _BATTERY_EVERY
            percent = self.faults.get("battery", _PERCENT)
            for bus, number, encoder in self._battery_frames:
                fields = {"percent": percent, "voltage": self.voltage, "current": 3.0}
                yield bus, CanFrame(number, encoder.encode(fields))

    def _imu(self) -> dict[str, float]:
        """Return the IMU's values by their names in frame maps."""
        imu = self._world.imu()
        if "frozen" in self.faults:
            imu = self._frozen = self._frozen or imu
        turn, gyro, accel = imu.rotation, imu.gyro, imu.accel
        if "upside" in self.faults:
            turn = Quaternion(-turn.x, turn.w, turn.z, -turn.y)  # half a turn about its own x
        noise = 0.0 if "frozen" in self.faults else _NOISE * (self._rng.random() - 0.5)
        return {
            "qw": turn.w,
            "qx": turn.x,
            "qy": turn.y,
            "qz": turn.z,
            "roll": math.atan2(2 * (turn.w * turn.x + turn.y * turn.z), 1 - 2 * (turn.x**2 + turn.y**2)),
            "pitch": math.asin(max(-1.0, min(1.0, 2 * (turn.w * turn.y - turn.z * turn.x)))),
            "yaw": turn.yaw,
            "gx": gyro.x,
            "gy": gyro.y,
            "gz": gyro.z,
            "ax": accel.x + noise,
            "ay": accel.y,
            "az": accel.z - noise,
        }


def _encoders(sensor: Sensor | None) -> list[tuple[str, int, FrameEncoder]]:
    """Return bus, identifier and encoder of each frame of a sensor."""
    return [(sensor.bus, frame.id, FrameEncoder(frame)) for frame in sensor.frames] if sensor else []
