"""Simulated moteus: registers, modes, watchdog of each command, diagnostics.

Like the real one it accepts every frame whose low byte is its id, answers only on request, limits its damping
to the share of its stiffness, and leaves a timeout or a fault only by a stop.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from fleet import CanFrame
from fleet_quadruped.drives.moteus import frames as wire
from fleet_quadruped.drives.moteus.frames import Subframe
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.parts import Drive
from fleet_quadruped.sim.drive import SimDampingDrive
from fleet_quadruped.sim.world import SimMotor

_FAULTS = {"overcurrent": 33, "hot": 38}
_KP, _KD = 120.0, 5.0  # N m/rad, N m s/rad of the joint: configured gains
_DEFAULTS: Mapping[int, float] = {
    0x20: 0.0,
    0x21: 0.0,
    0x22: 0.0,
    0x23: 1.0,
    0x24: 1.0,
    0x25: math.nan,
    0x26: math.nan,
    0x27: 0.0,
}
"""Default values of the command registers."""
_WRITABLE = frozenset({wire.STOPPED, wire.OBEYS, wire.DAMPS, wire.BRAKES})
_STARTING = 2  # first of the modes on the way to position mode
_LATCHED = frozenset({wire.FAILED, wire.TIMED_OUT})


class SimMoteus(SimDampingDrive):
    """One servo at one joint; ``send`` sends its frames."""

    def __init__(self, joint: Joint, motor: SimMotor, send: Callable[[CanFrame], None], drive: Drive) -> None:  # noqa: ARG002 - factory settings
        super().__init__(joint, motor, send)
        self.home = wire.REFERS_TO_OUTPUT
        self.stored = {
            "servo.pid_position.kp": _KP / self._square * wire.TURN,
            "servo.pid_position.kd": _KD / self._square * wire.TURN,
            "servo.pid_position.ki": 0.0,
            "servo.timeout_mode": float(wire.STOPPED),
            "servo.timeout_max_torque_Nm": 5.0,
        }
        self.hears = dict.fromkeys(wire.heard_by(joint.id), self._hear)
        self.boot()

    def boot(self) -> None:
        """Start as after power-on: stopped, with the stored configuration."""
        self.mode, self._code = wire.STOPPED, 0
        self.config = dict(self.stored)
        self._command = dict(_DEFAULTS)
        self._left = math.inf  # s for which the command is still valid
        self._starts = False  # on its way to position mode
        self._line = b""
        self._text = b""
        self._target = 0.0  # turns: target position, which moves with the velocity

    def fail(self, why: str) -> None:
        """Enter fault; the next answer reports it."""
        self.mode, self._code = wire.FAILED, _FAULTS[why]

    def pretend(self) -> None:
        """Be configured for a softer robot."""
        self.config["servo.pid_position.kp"] /= 10

    def control(self, dt: float) -> None:
        """Set the motor for the next ``dt`` seconds, and check the watchdog."""
        super().control(dt)
        if self._starts:
            self.mode, self._starts = wire.OBEYS, False
        if self.mode == wire.OBEYS:
            self._left -= dt
            if self._left < 0:
                self.mode = wire.TIMED_OUT
        mode = self.mode
        if mode == wire.TIMED_OUT:
            mode = int(self.config["servo.timeout_mode"])
        if mode == wire.OBEYS:
            self._obey(dt)
        elif mode in {wire.DAMPS, wire.BRAKES}:
            share = 1.0 if self.mode == wire.TIMED_OUT else self._command[0x24]
            self.motor.kd = self._gain("servo.pid_position.kd") * min(1.0, share)

    def _obey(self, dt: float) -> None:
        """Follow the command: its position moves with its velocity."""
        motor, command = self.motor, self._command
        self._target += command[0x21] * dt
        angle, speed, torque = self._units.joint(
            self._target * wire.TURN, command[0x21] * wire.TURN, command[0x22]
        )
        stiff = min(1.0, command[0x23])
        motor.kp = self._gain("servo.pid_position.kp") * stiff
        motor.kd = self._gain("servo.pid_position.kd") * min(stiff, command[0x24])
        motor.target, motor.target_speed, motor.feed = angle - self.encoder.off, speed, torque

    def _gain(self, name: str) -> float:
        """Return a gain of the joint, per rad."""
        return self.config[name] / wire.TURN * self._square

    def _hear(self, frame: CanFrame) -> None:
        """Execute the sub-frames, and answer if requested."""
        parts = wire.unpack(frame.data) if frame.fd else None
        if parts is None:
            return
        written = {
            register: value
            for part in parts
            if part.kind == 0
            for register, value in enumerate(part.values, part.start)
        }
        if wire.MODE in written:
            self._change(int(written[wire.MODE]), written)
        for part in parts:
            if part.kind == 0x40:
                self._line += part.text
                self._diagnose()
        if frame.id & wire.REPLY:
            self._answer(parts)

    def _change(self, mode: int, written: dict[int, float]) -> None:
        """Change to a mode, if it is reachable from the present one."""
        if mode == wire.STOPPED:
            self.mode, self._code, self._starts = wire.STOPPED, 0, False
            return
        if mode not in _WRITABLE or self.mode in _LATCHED:
            return
        self._starts = self._starts and mode == wire.OBEYS
        if mode == wire.OBEYS and self.mode == wire.STOPPED:
            if self._dozing:
                self._dozing -= 1
                return
            self._target, self._starts = self._position(), True
        self.mode, self._command = _STARTING if self._starts else mode, {**_DEFAULTS, **written}
        position = self._command[0x20]
        if not math.isnan(position):
            self._target = position
        self._left = self._command[0x27] or 0.1
        self._left = math.inf if math.isnan(self._left) else self._left

    def _position(self) -> float:
        """Return the measured position, turns."""
        return self._units.motor(self.encoder.angle, 0.0, 0.0)[0] / wire.TURN

    def _diagnose(self) -> None:
        """Answer complete lines: ``conf get NAME``, ``conf set NAME VALUE``."""
        while b"\n" in self._line:
            line, self._line = self._line.split(b"\n", 1)
            match line.decode("ascii", "replace").split():
                case ["conf", "get", name] if name in self.config:
                    self._text += f"{self.config[name]:.6f}\r\n".encode()
                case ["conf", "set", name, value] if name in self.config:
                    if not self._refusing:
                        self.config[name] = float(value)
                    self._text += b"OK\r\n"
                case _:
                    self._text += b"ERR unknown\r\n"

    def _answer(self, parts: list[Subframe]) -> None:
        """Send the requested registers and text."""
        _, speed, torque = self._units.motor(0.0, self.motor.speed, self.motor.torque)
        registers = {
            wire.MODE: float(self.mode),
            wire.POSITION: self._position(),
            wire.VELOCITY: speed / wire.TURN,
            wire.TORQUE: torque,
            wire.HOME: float(self.home),
            wire.VOLTAGE: self.voltage,
            wire.TEMPERATURE: self._temperature,
            wire.FAULT: float(self._code),
        }
        reply = b""
        for part in parts:
            if part.kind == 1:
                asked = range(part.start, part.start + part.size)
                values = tuple([registers.get(register, 0.0) for register in asked])
                reply += wire.pack_reply(part.resolution, part.start, values)
            elif part.kind == 0x42:
                reply += wire.pack_answer(self._text)
                self._text = b""
        data = wire.padded(reply)
        self._send(CanFrame(wire.from_servo(self.joint.id), data[:2] if self._terse else data, fd=True))
