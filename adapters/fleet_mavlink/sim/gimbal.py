"""Simulated gimbal behind the autopilot's gimbal manager: pitch and yaw, in the vehicle's frame."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.command_request import ACCEPTED, DENIED, CommandRequest

_PITCH = (-90.0, 30.0)  # degrees
_YAW = (-160.0, 160.0)
_FASTEST = 60.0  # degrees per second
_REPORT_INTERVAL = 0.2  # s
_ITSELF = -2.0  # in DO_GIMBAL_MANAGER_CONFIGURE: the sender
DEVICE = 154


class SimGimbal:
    """Turns to angles or at rates, only for the station that took control of it."""

    def __init__(self) -> None:
        self.pitch = self.yaw = 0.0  # degrees
        self._pitch = _Axis()
        self._yaw = _Axis()
        self._owner: tuple[int, int] | None = None
        self._reported_at = -math.inf

    def configure(self, request: CommandRequest) -> int:
        """Take control (DO_GIMBAL_MANAGER_CONFIGURE): for the given ids, or for the sender."""
        if request.p1 == _ITSELF:
            self._owner = (request.system, request.component)
        elif request.p1 >= 0.0:
            self._owner = (int(request.p1), int(request.p2))
        return ACCEPTED

    def turn(self, request: CommandRequest) -> int:
        """Turn (DO_GIMBAL_MANAGER_PITCHYAW): degrees and degrees per second, NaN leaves an axis unchanged."""
        if self._owner != (request.system, request.component):
            return DENIED
        self._pitch.request(request.p1, request.p3)
        self._yaw.request(request.p2, request.p4)
        return ACCEPTED

    def tick(self, dt: float) -> None:
        """Advance by ``dt`` seconds."""
        self.pitch = self._pitch.moved(self.pitch, _PITCH, dt)
        self.yaw = self._yaw.moved(self.yaw, _YAW, dt)

    def information(self, boot_ms: int) -> object:
        """Return GIMBAL_MANAGER_INFORMATION."""
        limits = (0.0, 0.0, *map(math.radians, (*_PITCH, *_YAW)))
        return mav.MAVLink_gimbal_manager_information_message(boot_ms, 0, DEVICE, *limits)

    def due(self, now: float, boot_ms: int) -> list[object]:
        """Return GIMBAL_DEVICE_ATTITUDE_STATUS if it is due."""
        if now - self._reported_at < _REPORT_INTERVAL:
            return []
        self._reported_at = now
        pitch, yaw = math.radians(self.pitch) / 2, math.radians(self.yaw) / 2
        cp, sp, cy, sy = math.cos(pitch), math.sin(pitch), math.cos(yaw), math.sin(yaw)
        turned = [cp * cy, -sp * sy, sp * cy, cp * sy]
        return [
            mav.MAVLink_gimbal_device_attitude_status_message(
                0, 0, boot_ms, 12, turned, 0.0, 0.0, 0.0, 0, gimbal_device_id=0
            )
        ]


class _Axis:
    """Request for one axis: a target angle, or a rate."""

    def __init__(self) -> None:
        self._angle: float | None = None
        self._speed = 0.0

    def request(self, angle: float, speed: float) -> None:
        """Set an angle, else a rate; two NaNs change nothing."""
        if math.isfinite(angle):
            self._angle = angle
        elif math.isfinite(speed):
            self._angle, self._speed = None, speed

    def moved(self, now: float, limits: tuple[float, float], dt: float) -> float:
        """Return the angle after ``dt`` seconds, within the limits."""
        step = self._speed * dt if self._angle is None else self._angle - now
        step = max(-_FASTEST * dt, min(_FASTEST * dt, step))
        return max(limits[0], min(limits[1], now + step))
