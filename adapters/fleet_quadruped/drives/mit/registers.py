"""Registers of Damiao motors: check of the ranges, setting of the watchdog."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from fleet import CanFrame, LinkRefused
from fleet_quadruped.drives.drive_requester import DriveRequester
from fleet_quadruped.drives.mit import frames as wire
from fleet_quadruped.drives.mit.motor import MitMotor
from fleet_quadruped.drives.mit.profiles import profile_name
from fleet_quadruped.robot.parts import Drive

_NAMES = ("PMAX", "VMAX", "TMAX")


class DamiaoRegisters:
    """Registers of some Damiao motors, as read."""

    def __init__(self, motors: Sequence[MitMotor], requester: DriveRequester) -> None:
        self._motors = motors
        self._requester = requester
        self._values: dict[tuple[str, int, int], bytes] = {}  # by bus, motor and register

    def handle_answer(self, motor: MitMotor, data: bytes) -> bool:
        """Process an answer of a motor; False for any other frame."""
        decoded = wire.unpack_register(data)
        if decoded is None or decoded[0] != motor.id:
            return False
        self._values[motor.joint.bus, motor.id, decoded[1]] = decoded[2]
        return True

    def commission(self, drive: Drive) -> None:
        """Check the ranges of all motors and set their watchdog; raises LinkLost or LinkRefused.

        Earlier values are dropped: a motor that was off in the meantime has lost its watchdog setting.
        """
        self._values.clear()
        for register in wire.RANGE_REGISTERS:
            self._read(register)
        self._check_ranges(drive)
        self._set_watchdog(drive.timeout)

    def _set_watchdog(self, seconds: float) -> None:
        """Set the watchdog of all motors and verify it."""
        register, timeout = wire.TIMEOUT_REGISTER, wire.timeout_value(seconds)
        self._requester.request(
            self._motors,
            lambda motor: CanFrame(wire.REGISTERS, wire.write_register(motor.id, register, timeout)),
            lambda motor: self._value(motor, register) is not None,
        )
        self._values.clear()  # the answers to the writes
        self._read(register)
        for motor in self._motors:
            actual = self._value(motor, register)
            if actual != timeout:
                raise LinkRefused(f"{motor.joint.name}: register 9 (watchdog) is {actual!r}, not {timeout!r}")

    def _check_ranges(self, drive: Drive) -> None:
        """Raise LinkRefused for motors whose ranges differ from their profile."""
        for motor in self._motors:
            wanted = motor.profile.angle, motor.profile.speed, motor.profile.torque
            for register, name, most in zip(wire.RANGE_REGISTERS, _NAMES, wanted, strict=True):
                (actual,) = struct.unpack("<f", self._value(motor, register) or bytes(4))
                if not math.isclose(actual, most, rel_tol=1e-3):
                    raise LinkRefused(
                        f"{motor.joint.name}: register {register} ({name}) is {actual:g}, "
                        f"wanted {most:g} for {profile_name(drive, motor.joint.kind)}"
                    )

    def _read(self, register: int) -> None:
        """Read one register of all motors."""
        self._requester.request(
            self._motors,
            lambda motor: CanFrame(wire.REGISTERS, wire.read_register(motor.id, register)),
            lambda motor: self._value(motor, register) is not None,
        )

    def _value(self, motor: MitMotor, register: int) -> bytes | None:
        return self._values.get((motor.joint.bus, motor.id, register))
