"""Simulated MIT motor: special frames, commands, replies, Damiao registers and watchdog."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable

from fleet import CanFrame
from fleet_quadruped.drives.mit import frames as wire
from fleet_quadruped.drives.mit.frames import MitCommand, MitSetpoint
from fleet_quadruped.drives.mit.profiles import profile_of
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.parts import Drive
from fleet_quadruped.sim.drive import SimDampingDrive
from fleet_quadruped.sim.world import SimMotor

_STATUS = {"overcurrent": 0xA, "hot": 0xC}
_LOST = 0xD


class SimMitDrive(SimDampingDrive):
    """One motor at one joint; ``send`` sends its frames."""

    def __init__(self, joint: Joint, motor: SimMotor, send: Callable[[CanFrame], None], drive: Drive) -> None:
        super().__init__(joint, motor, send)
        self._profile = profile_of(drive, joint.kind)
        self._layout = wire.MitLayout(self._profile)
        ranges = (self._profile.angle, self._profile.speed, self._profile.torque)
        self._registers = {
            register: struct.pack("<f", value)
            for register, value in zip(wire.RANGE_REGISTERS, ranges, strict=True)
        }
        self._registers[wire.TIMEOUT_REGISTER] = bytes(4)
        self._registers[wire.MASTER_REGISTER] = struct.pack("<I", wire.MASTER + joint.id)
        self.status = 0
        self._command: MitSetpoint = MitCommand()
        self._silence = 0.0
        self._timeout = math.inf  # s of silence after which it takes the torque off
        self._place = (wire.MASTER + joint.id) if self._profile.damiao else 0  # identifier of its replies
        self.hears = {joint.id: self._obey}
        if self._profile.damiao:
            self.hears = {**self.hears, wire.REGISTERS: self._register}

    def boot(self) -> None:
        """Start as after power-on: disabled, with the stored registers."""
        self.status = 0
        self._registers[wire.TIMEOUT_REGISTER] = bytes(4)
        self._timeout = math.inf

    def fail(self, why: str) -> None:
        """Enter fault; the next reply reports it."""
        self.status = _STATUS[why]

    def pretend(self) -> None:
        """Be a motor with other ranges."""
        self._registers[wire.RANGE_REGISTERS[0]] = struct.pack("<f", self._profile.angle * 2)

    def control(self, dt: float) -> None:
        """Set the motor for the next ``dt`` seconds, and check the watchdog."""
        super().control(dt)
        self._silence += dt
        if self.status == wire.ENABLED and self._silence > self._timeout:
            self.status = _LOST
        if self.status != wire.ENABLED:
            return
        motor = self.motor
        angle, speed, kp, kd, torque = self._command
        motor.kp, motor.kd = kp * self._square, kd * self._square
        target, motor.target_speed, motor.feed = self._units.joint(angle, speed, torque)
        motor.target = target - self.encoder.off

    def _obey(self, frame: CanFrame) -> None:
        """Execute a special frame or a command, and reply."""
        data = frame.data
        if len(data) != 8:
            return
        self._silence = 0.0
        if data not in wire.SPECIAL:
            self._command = self._layout.unpack_command(data) or self._command
        elif data == wire.ENABLE:
            self._command = MitCommand()
            if self._dozing:
                self._dozing -= 1
            elif self.status == 0:
                self.status = wire.ENABLED
        elif data == wire.DISABLE:
            self.status = 0 if self.status == wire.ENABLED else self.status
        else:
            self.status = 0
        self._reply()

    def _reply(self) -> None:
        """Send the feedback."""
        motor = self.motor
        angle, speed, torque = self._units.motor(self.encoder.angle, motor.speed, motor.torque)
        reply = (self.joint.id, angle, speed, torque, self.status, self._temperature)
        data = self._layout.pack_reply(reply)
        self._send(CanFrame(self._place, data[:2] if self._terse else data))

    def _register(self, frame: CanFrame) -> None:
        """Answer a read or write of a register."""
        data = frame.data
        decoded = wire.unpack_register(data)
        if decoded is None or decoded[0] != self.joint.id or decoded[1] not in self._registers:
            return
        motor, register, value = decoded
        if data[2] == wire.WRITE and not self._refusing:
            self._registers[register] = value
            self._timeout = _timeout(self._registers[wire.TIMEOUT_REGISTER])
        answer = struct.pack("<HBB4s", motor, data[2], register, self._registers[register])
        self._send(CanFrame(wire.MASTER + self.joint.id, answer))


def _timeout(register: bytes) -> float:
    """Return the watchdog timeout in s; infinite without one."""
    (ticks,) = struct.unpack("<I", register)
    return ticks * 50e-6 or math.inf
