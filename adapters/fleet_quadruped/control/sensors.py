"""Sensors besides the drives: IMU and battery, from mapped CAN frames."""

from __future__ import annotations

import math

from fleet import CanFrame, Quaternion, Vector3, quaternion_from_euler
from fleet_quadruped.body.measured import MeasuredImu
from fleet_quadruped.frames import FrameDecoder
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import EULER
from fleet_quadruped.robot.parts import Sensor

_POSSIBLE = dict.fromkeys(EULER, 7.0) | {
    "qw": 2.0,
    "qx": 2.0,
    "qy": 2.0,
    "qz": 2.0,
    "gx": 100.0,
    "gy": 100.0,
    "gz": 100.0,
}
"""Largest plausible values (rad/s for rates): an implausible one would stay in the odometry for ever."""


class SensorValues:
    """Newest values of one sensor, by name; a value marked invalid is dropped.

    ``whole``: a frame with an invalid or implausible value is ignored entirely.
    """

    def __init__(self, sensor: Sensor, *, whole: bool = False) -> None:
        self.frames = frozenset((sensor.bus, frame.id) for frame in sensor.frames)
        self._names = {frame.id: frozenset(frame.fields) for frame in sensor.frames}
        self._whole = whole
        self._doubtful = {
            frame.id: [
                name for name, field in frame.fields.items() if field.farthest > _POSSIBLE.get(name, math.inf)
            ]
            for frame in sensor.frames
            if whole
        }
        self._decoder = FrameDecoder(sensor.frames)
        self._times: dict[int, float] = {}
        self.values: dict[str, float] = {}

    def handle_frame(self, frame: CanFrame, now: float) -> None:
        """Process one of ``frames`` (bus, id), received at ``now``."""
        found = self._decoder.decode(frame.id, frame.data)
        if not found or not self._is_possible(frame.id, found):
            return
        if len(found) < len(self._names[frame.id]):
            if self._whole:
                return
            for name in self._names[frame.id] - found.keys():
                self.values.pop(name, None)
        self.values.update(found)
        self._times[frame.id] = now

    def _is_possible(self, identifier: int, found: dict[str, float]) -> bool:
        """Return False for a frame with an implausible value."""
        doubtful = self._doubtful.get(identifier)
        return not doubtful or all(abs(found.get(name, 0.0)) <= _POSSIBLE[name] for name in doubtful)

    def age(self, now: float) -> float:
        """Return the age of the oldest frame; infinite until all have arrived."""
        if len(self._times) < len(self.frames):
            return math.inf
        return now - min(self._times.values())


class BodySensors:
    """IMU and battery of a robot, if it has them. ``imu``: its measurement while it is fresh.

    ``imu_age``: s; 0 without an IMU. ``battery``: newest values by name.
    """

    def __init__(self, dog: DogDescription) -> None:
        self.imu: MeasuredImu | None = None
        self.imu_age = 0.0
        self._imu = SensorValues(dog.imu, whole=True) if dog.imu else None
        self._imu_timeout = dog.imu.timeout if dog.imu else 0.0
        self._battery = SensorValues(dog.battery) if dog.battery else None
        self._described = dog.battery
        self._by_frame = {
            place: sensor
            for sensor in (self._imu, self._battery)
            if sensor is not None
            for place in sensor.frames
        }

    def handle_frame(self, bus: str, frame: CanFrame, now: float) -> bool:
        """Process a received frame; False if it is not from a sensor."""
        sensor = self._by_frame.get((bus, frame.id))
        if sensor is not None:
            sensor.handle_frame(frame, now)
        return sensor is not None

    def update(self, now: float) -> None:
        """Evaluate the IMU in a cycle."""
        if self._imu is not None:
            self.imu_age = self._imu.age(now)
            self.imu = imu_of(self._imu.values) if self.imu_age <= self._imu_timeout else None

    @property
    def battery(self) -> dict[str, float]:
        """Last values of the battery, by name."""
        return self._battery.values if self._battery else {}

    def battery_age(self, now: float) -> float | None:
        """Return the age of the battery's values, s; None before the first."""
        return self._battery.age(now) if self._battery and self._battery.values else None

    def fresh_battery(self, now: float) -> dict[str, float]:
        """Return the battery's values; empty while it is silent."""
        reported, described = self._battery, self._described
        return reported.values if reported and described and reported.age(now) < described.timeout else {}

    def battery_warning(self, now: float, began_at: float) -> str:
        """Return the battery warning for the operator, or ""; ``began_at``: start (monotonic s)."""
        reported, described = self._battery, self._described
        if reported is None or described is None:
            return ""
        if min(reported.age(now), now - began_at) > described.timeout:
            return f"battery: silent on bus {described.bus}; it may run empty unnoticed: check its frames"
        percent = reported.values.get("percent")
        if percent is not None and percent <= described.warn:
            return f"battery at {percent:.0f} %"
        return ""


def imu_of(values: dict[str, float]) -> MeasuredImu | None:
    """Return the IMU measurement from its values; None if one is missing or the quaternion is invalid.

    The attitude is a quaternion, or roll, pitch and yaw (rad, about x, then y, then z of the body).
    """
    try:
        if "qw" not in values:
            turn = quaternion_from_euler(values["roll"], values["pitch"], values["yaw"])
            w, x, y, z = turn.w, turn.x, turn.y, turn.z
        else:
            w, x, y, z = values["qw"], values["qx"], values["qy"], values["qz"]
        gyro = Vector3(values["gx"], values["gy"], values["gz"])
        accel = Vector3(values.get("ax", 0.0), values.get("ay", 0.0), values.get("az", 0.0))
    except KeyError:
        return None
    length = math.sqrt(w * w + x * x + y * y + z * z)
    if not 0.5 < length < 1.5:
        return None
    return MeasuredImu(Quaternion(w / length, x / length, y / length, z / length), gyro, accel)
