"""Profiles of MIT motors: ranges, replies, features. Ranges are never guessed.

Other motors are described in YAML, below ``drive.profiles``.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from fleet_quadruped.robot.parts import Actuator, Drive


class MotorProfile(NamedTuple):
    """One motor: +- rad, rad/s, N m of its frames; largest kp and kd.

    ``damiao``: status in the reply, registers, a watchdog of its own; other motors have no status and no
    reset. ``temperature_at``: byte of a reply with the temperature; ``coldest``: degrees C of a zero in it.
    """

    angle: float
    speed: float
    torque: float
    kp: float = 500.0
    kd: float = 5.0
    damiao: bool = False
    temperature_at: int | None = None
    coldest: int = 0
    error_at: int | None = None


PROFILES: Mapping[str, MotorProfile] = MappingProxyType(
    {
        "tmotor-ak80-6": MotorProfile(12.5, 76.0, 12.0),
        "tmotor-ak80-9": MotorProfile(12.5, 25.64, 18.0),
        "tmotor-ak80-6-v1": MotorProfile(95.5, 45.0, 18.0),
        "tmotor-ak80-6-v1.1": MotorProfile(12.5, 22.5, 12.0),
        "tmotor-ak80-9-v1.1": MotorProfile(12.5, 22.5, 18.0),
        "cubemars-ak70-10": MotorProfile(12.5, 50.0, 25.0, temperature_at=6, coldest=-40, error_at=7),
        "cubemars-ak10-9": MotorProfile(12.5, 50.0, 65.0, temperature_at=6, coldest=-40, error_at=7),
        "damiao-4310": MotorProfile(12.5, 30.0, 10.0, damiao=True, temperature_at=7),
        "damiao-4310-48v": MotorProfile(12.5, 50.0, 10.0, damiao=True, temperature_at=7),
        "damiao-4340": MotorProfile(12.5, 8.0, 28.0, damiao=True, temperature_at=7),
        "damiao-6006": MotorProfile(12.5, 45.0, 20.0, damiao=True, temperature_at=7),
        "damiao-8006": MotorProfile(12.5, 45.0, 40.0, damiao=True, temperature_at=7),
        "damiao-8009": MotorProfile(12.5, 45.0, 54.0, damiao=True, temperature_at=7),
        "damiao-10010l": MotorProfile(12.5, 25.0, 200.0, damiao=True, temperature_at=7),
        "damiao-h3510": MotorProfile(12.5, 280.0, 1.0, damiao=True, temperature_at=7),
    }
)


def profile_name(drive: Drive, kind: Actuator) -> str:
    """Return the name of the motor profile for joints of one kind."""
    return kind.profile or drive.profile


def profile_of(drive: Drive, kind: Actuator) -> MotorProfile:
    """Return the motor profile for joints of one kind; raises KeyError for an unknown one."""
    name = profile_name(drive, kind)
    described = drive.profiles.get(name)
    return PROFILES[name] if described is None else MotorProfile(**described.model_dump())
