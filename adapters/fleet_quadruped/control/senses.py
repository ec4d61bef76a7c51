"""The sensors that are not in the joints: IMU and battery, from CAN frames by map."""

from __future__ import annotations

import math

from fleet import Quaternion, Vector3
from fleet_quadruped.body.sense import Imu
from fleet_quadruped.can.frame import Frame
from fleet_quadruped.frames import Decoder
from fleet_quadruped.robot.parts import Sensor


class Values:
    """The newest values of one sensor, by name; a value that is told to be invalid is not known any more.

    ``whole``: a frame with an invalid value does not count at all.
    """

    def __init__(self, sensor: Sensor, *, whole: bool = False) -> None:
        self.frames = frozenset((sensor.bus, frame.id) for frame in sensor.frames)
        self._names = {frame.id: frame.fields.keys() for frame in sensor.frames}
        self._whole = whole
        self._decoder = Decoder(sensor.frames)
        self._times: dict[int, float] = {}
        self.values: dict[str, float] = {}

    def take(self, frame: Frame, now: float) -> None:
        """Take one of ``frames`` (bus, id) that was received at ``now``."""
        found = self._decoder.decode(frame.id, frame.data)
        if not found:
            return
        if len(found) < len(self._names[frame.id]):
            if self._whole:
                return
            for name in self._names[frame.id] - found.keys():
                self.values.pop(name, None)
        self.values.update(found)
        self._times[frame.id] = now

    def age(self, now: float) -> float:
        """Return the age of the oldest frame; infinite while one has never come."""
        if len(self._times) < len(self.frames):
            return math.inf
        return now - min(self._times.values())


def imu_of(values: dict[str, float]) -> Imu | None:
    """Return the IMU from its values; None when one is missing or the rotation is none."""
    try:
        w, x, y, z = values["qw"], values["qx"], values["qy"], values["qz"]
        gyro = Vector3(values["gx"], values["gy"], values["gz"])
        accel = Vector3(values.get("ax", 0.0), values.get("ay", 0.0), values.get("az", 0.0))
    except KeyError:
        return None
    length = math.sqrt(w * w + x * x + y * y + z * z)
    if not 0.5 < length < 1.5:
        return None
    return Imu(Quaternion(w / length, x / length, y / length, z / length), gyro, accel)
