"""Telemetry of a self-walking machine: mode, velocity, attitude, battery, and odometry."""

from __future__ import annotations

import math

from fleet import CanFrame, Quaternion, quaternion_from_yaw
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.measured import MeasuredImu
from fleet_quadruped.control.sensors import SensorValues, imu_of
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.selfwalk.description import SelfWalker
from fleet_quadruped.selfwalk.wire import AXES


class Telemetry:
    """Newest state of a machine. ``now``: monotonic time of the last update.

    ``error``: its reported error; ``unnamed``: a mode missing from its description; both empty if there is
    none. ``x``, ``y`` (m) and ``yaw`` (rad) are its odometry.
    """

    def __init__(self, walker: SelfWalker) -> None:
        self.mode = BodyMode.OFF
        self.error = self.unnamed = ""
        self.imu: MeasuredImu | None = None
        self.x = self.y = self.yaw = 0.0
        self.now = 0.0
        self._walker = walker
        state, slow = walker.sensors()
        self._state = SensorValues(state)
        self._slow = SensorValues(slow) if slow else None

    def handle_frame(self, bus: str, frame: CanFrame, now: float) -> None:
        """Process a received frame; frames of others are ignored."""
        for source in (self._state, self._slow):
            if source is not None and (bus, frame.id) in source.frames:
                source.handle_frame(frame, now)

    def update(self, now: float, dt: float) -> None:
        """Update from the received values; stale ones change nothing."""
        self.now = now
        values = self._state.values
        if self.is_stale:
            return
        number = round(values.get("mode", -1))
        self.mode = self._walker.modes.get(number, BodyMode.UNKNOWN)
        known = number in self._walker.modes
        self.unnamed = "" if known else f"it reports mode {number}, which is not in modes"
        error = round(values.get("error", 0))
        self.error = f"{self._walker.errors.get(error, 'error')} (error {error})" if error else ""
        self.imu = imu_of(values)
        seen = self.twist
        self.yaw = self.imu.rotation.yaw if self.imu else values.get("yaw", self.yaw + seen.turn * dt)
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        self.x += (cos * seen.x - sin * seen.y) * dt
        self.y += (sin * seen.x + cos * seen.y) * dt

    def age(self, now: float) -> float:
        """Return the age of its state, s."""
        return self._state.age(now)

    @property
    def is_stale(self) -> bool:
        """True if its state was too old at the last update."""
        return self._state.age(self.now) > self._walker.timeout

    @property
    def twist(self) -> Twist:
        """Reported velocity."""
        return Twist(*(self._state.values.get(name, 0.0) for name in AXES))

    @property
    def rotation(self) -> Quaternion:
        """Attitude, body to world."""
        return self.imu.rotation if self.imu else quaternion_from_yaw(self.yaw)

    @property
    def height(self) -> float | None:
        """Height of its body, m; None if it does not report one."""
        return self._state.values.get("height")

    @property
    def battery(self) -> dict[str, float]:
        """Last values of its battery, by name."""
        return dict(self._slow.values) if self._slow else {}

    def battery_age(self, now: float) -> float | None:
        """Return the age of the battery's values, s; None before the first."""
        return self._slow.age(now) if self._slow and self._slow.values else None

    @property
    def percent(self) -> float | None:
        """Battery level in percent while it is fresh."""
        slow, most = self._slow, self._walker.slow_timeout
        return slow.values.get("percent") if slow and slow.age(self.now) < most else None
