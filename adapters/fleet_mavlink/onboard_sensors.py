"""State of a vehicle's payload and sensors, and its present target: a value, and its reducer."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from fleet import GeoPoint, Quaternion, Vector3
from fleet_mavlink.messages import MavlinkMessage, PositionTargetGlobalInt
from fleet_mavlink.payload_messages import (
    EscTelemetry1To4,
    GimbalDeviceAttitudeStatus,
    HighresImu,
    RawImu,
)

_GRAVITY = 9.80665  # m/s2
_INERTIAL = 0x3F  # fields_updated: acceleration and rates, all axes


class ImuSample(msgspec.Struct, frozen=True):
    """Body rates in rad/s and specific force in m/s2, FRD."""

    gyro: Vector3
    accel: Vector3


class GimbalAngles(msgspec.Struct, frozen=True):
    """Angles of a gimbal, degrees; pitch down is negative, yaw right of the nose is positive."""

    pitch: float
    yaw: float


class OnboardSensors(msgspec.Struct, frozen=True):
    """Latest values; times are monotonic seconds of arrival; None or empty before the first.

    ``motors``: rad/s, in the autopilot's order. ``bound_for``: the reported target position, altitude AMSL.
    """

    imu: ImuSample | None = None
    imu_at: float = -math.inf
    aim: GimbalAngles | None = None
    motors: tuple[float, ...] = ()
    motors_at: float = -math.inf
    bound_for: GeoPoint | None = None
    bound_at: float = -math.inf


def reduce_sensors(sensors: OnboardSensors, message: MavlinkMessage, now: float) -> OnboardSensors:
    """Return the state after ``message``, which arrived at monotonic ``now``."""
    change = CHANGES.get(type(message))
    return change(sensors, message, now) if change else sensors


def _raw_imu(sensors: OnboardSensors, message: RawImu, now: float) -> OnboardSensors:
    """Apply a measurement of ArduPilot's IMU."""
    accel = Vector3(message.xacc, message.yacc, message.zacc).scaled(_GRAVITY / 1000)
    gyro = Vector3(message.xgyro, message.ygyro, message.zgyro).scaled(1 / 1000)
    return msgspec.structs.replace(sensors, imu=ImuSample(gyro, accel), imu_at=now)


def _highres_imu(sensors: OnboardSensors, message: HighresImu, now: float) -> OnboardSensors:
    """Apply a measurement of PX4's IMU, if it is complete."""
    gyro = (message.xgyro, message.ygyro, message.zgyro)
    accel = (message.xacc, message.yacc, message.zacc)
    if message.fields_updated & _INERTIAL != _INERTIAL or not all(map(math.isfinite, (*gyro, *accel))):
        return sensors
    return msgspec.structs.replace(sensors, imu=ImuSample(Vector3(*gyro), Vector3(*accel)), imu_at=now)


def _gimbal(sensors: OnboardSensors, message: GimbalDeviceAttitudeStatus, _now: float) -> OnboardSensors:
    """Apply the attitude of the gimbal, if it is a valid quaternion."""
    if not all(map(math.isfinite, message.q)):
        return sensors
    try:
        turned = Quaternion(*message.q).normalized()
    except ValueError:
        return sensors
    pitch = math.asin(max(-1.0, min(1.0, 2 * (turned.w * turned.y - turned.z * turned.x))))
    return msgspec.structs.replace(sensors, aim=GimbalAngles(math.degrees(pitch), math.degrees(turned.yaw)))


def _motors(sensors: OnboardSensors, message: EscTelemetry1To4, now: float) -> OnboardSensors:
    """Apply the speeds of the motors."""
    speeds = tuple(rpm * math.tau / 60 for rpm in message.rpm)
    return msgspec.structs.replace(sensors, motors=speeds, motors_at=now)


def _bound_for(sensors: OnboardSensors, message: PositionTargetGlobalInt, now: float) -> OnboardSensors:
    """Apply the autopilot's present target."""
    place = GeoPoint(message.lat_int / 1e7, message.lon_int / 1e7, message.alt)
    return msgspec.structs.replace(sensors, bound_for=place, bound_at=now)


CHANGES: Mapping[type[MavlinkMessage], Callable[[OnboardSensors, Any, float], OnboardSensors]] = {
    EscTelemetry1To4: _motors,
    GimbalDeviceAttitudeStatus: _gimbal,
    HighresImu: _highres_imu,
    PositionTargetGlobalInt: _bound_for,
    RawImu: _raw_imu,
}
