"""Simulated ODrive: remote frames, heartbeat, axis states, gains, parameters, watchdog.

Like the real one it reports its position only on request, does not acknowledge commands, and feeds its
watchdog with positions only. An expired watchdog disarms it, without torque, until its errors are cleared.
"""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Callable, Mapping
from typing import ClassVar

from fleet import CanFrame
from fleet_quadruped.drives.odrive import frames as wire
from fleet_quadruped.drives.odrive.frames import OdriveCommand, State
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.parts import Drive
from fleet_quadruped.sim.drive import SimDampingDrive
from fleet_quadruped.sim.world import SimMotor

_BEAT = 0.1  # s, heartbeat period
_ERRORS = {"overcurrent": 1 << 10, "hot": 1 << 13}
_POSITION_GAIN, _VELOCITY_GAIN = 20.0, 1 / 6  # 1/s, N m s/turn: factory settings
_SERIALS = itertools.count(1)
_OFF, _ON = b"\x00", b"\x01"


class SimOdrive(SimDampingDrive):
    """One drive at one joint; ``send`` sends its frames."""

    def __init__(self, joint: Joint, motor: SimMotor, send: Callable[[CanFrame], None], drive: Drive) -> None:
        self._serial = next(_SERIALS).to_bytes(6, "little")
        super().__init__(joint, motor, send)
        self._endpoints = drive.endpoints
        self._stored = math.inf if drive.endpoints else drive.timeout  # s: as set in odrivetool
        self._version = wire.OLDEST
        self._beat_in = _BEAT
        self._commands: Mapping[int, Callable[[bytes], None]] = {
            OdriveCommand.STATE: self._request,
            OdriveCommand.MODES: self._set_modes,
            OdriveCommand.INPUT_POS: self._input,
            OdriveCommand.POS_GAIN: self._set_position_gain,
            OdriveCommand.VEL_GAINS: self._set_velocity_gains,
            OdriveCommand.CLEAR: self._clear,
            OdriveCommand.PARAMETER: self._parameter,
        }
        self.hears = {wire.identifier(joint.id, command): self._hear for command in OdriveCommand}
        self.boot()

    def boot(self) -> None:
        """Start as after power-on: disarmed, with the stored configuration."""
        self.state, self.errors = int(State.IDLE), 0
        self._parameters: dict[int, bytes] = {}
        if self._endpoints is not None:
            self._parameters = {
                self._endpoints.enable_watchdog: _OFF,
                self._endpoints.watchdog_timeout: struct.pack("<f", 0.0),
            }
        self._position_gain, self._velocity_gain = _POSITION_GAIN, _VELOCITY_GAIN
        self._obeys = False  # position control with the input passed through
        self._target = (0.0, 0.0, 0.0)
        self._unfed = 0.0

    def mute(self) -> None:
        """Send and receive nothing any more."""
        super().mute()
        self._beat_in = math.inf

    def fail(self, why: str) -> None:
        """Disarm with an error; the next heartbeat reports it."""
        self.errors, self.state = _ERRORS[why], State.IDLE

    def pretend(self) -> None:
        """Have an old firmware."""
        self._version = (0, 5)

    @property
    def watchdog(self) -> float:
        """Time without a position until it disarms, s."""
        ends = self._endpoints
        if ends is None:
            return self._stored
        (seconds,) = struct.unpack("<f", self._parameters[ends.watchdog_timeout])
        return float(seconds) if self._parameters[ends.enable_watchdog] == _ON else math.inf

    def control(self, dt: float) -> None:
        """Set the motor for the next ``dt`` seconds; serve watchdog and heartbeat."""
        super().control(dt)
        self._beat_in -= dt
        if self._beat_in <= 0:
            self._beat_in += _BEAT
            self._say(OdriveCommand.HEARTBEAT)
        if self.state != State.CLOSED_LOOP:
            return
        self._unfed += dt
        if self._unfed > self.watchdog:
            self.errors, self.state = wire.WATCHDOG_EXPIRED, State.IDLE
            return
        motor = self.motor
        damping = self._velocity_gain / wire.TURN * self._square
        motor.kp, motor.kd = self._position_gain * damping, damping
        target, motor.target_speed, motor.feed = self._units.joint(*self._target)
        motor.target = target - self.encoder.off

    def _hear(self, frame: CanFrame) -> None:
        """Answer a remote frame, or execute a command."""
        _, command = wire.split(frame.id)
        if frame.remote:
            self._say(command)
        elif command in self._commands:
            self._commands[command](frame.data)

    def _say(self, command: int) -> None:
        if command in self._ANSWERS:
            data = self._ANSWERS[command](self)
            self._send(
                CanFrame(
                    wire.identifier(self.joint.id, OdriveCommand(command)), data[:2] if self._terse else data
                )
            )

    def _request(self, data: bytes) -> None:
        """Enter a requested state; closed loop starts at the present position, and not with an error."""
        if len(data) < 4:
            return
        (state,) = struct.unpack_from("<I", data)
        if state == State.IDLE:
            self.state = State.IDLE
        elif state == State.CLOSED_LOOP and self.state == State.IDLE and not self.errors:
            if self._dozing:
                self._dozing -= 1
                return
            self._target = self._units.motor(self.encoder.angle, 0.0, 0.0)
            self.state, self._unfed = State.CLOSED_LOOP, 0.0

    def _set_modes(self, data: bytes) -> None:
        self._obeys = data == wire.pack_modes()

    def _input(self, data: bytes) -> None:
        decoded = wire.unpack_input(data)
        self._unfed = 0.0
        if decoded is not None and self._obeys:
            self._target = decoded

    def _set_position_gain(self, data: bytes) -> None:
        if len(data) >= 4:
            (self._position_gain,) = struct.unpack_from("<f", data)

    def _set_velocity_gains(self, data: bytes) -> None:
        decoded = wire.unpack_pair(data)
        if decoded is not None:
            self._velocity_gain = decoded[0]

    def _clear(self, _data: bytes) -> None:
        self.errors = 0

    def _parameter(self, data: bytes) -> None:
        """Set or report a parameter; an unknown one is not answered."""
        decoded = wire.unpack_parameter(data)
        if decoded is None or decoded[1] not in self._parameters:
            return
        operation, endpoint, value = decoded
        if operation:
            kept = self._parameters[endpoint]
            self._parameters[endpoint] = kept if self._refusing else value[: len(kept)]
            return
        answer = struct.pack("<BHx", 0, endpoint) + self._parameters[endpoint]
        self._send(CanFrame(wire.identifier(self.joint.id, OdriveCommand.TX_SDO), answer))

    def _estimates(self) -> bytes:
        angle, speed, _ = self._units.motor(self.encoder.angle, self.motor.speed, 0.0)
        return wire.pack_pair(angle / wire.TURN, speed / wire.TURN)

    def _torques(self) -> bytes:
        _, _, torque = self._units.motor(0.0, 0.0, self.motor.torque)
        return wire.pack_pair(torque, torque)

    _ANSWERS: ClassVar[Mapping[int, Callable[[SimOdrive], bytes]]] = {
        OdriveCommand.VERSION: lambda self: wire.pack_version(*self._version),
        OdriveCommand.HEARTBEAT: lambda self: wire.pack_heartbeat(self.errors, self.state),
        OdriveCommand.ADDRESS: lambda self: bytes([self.joint.id]) + self._serial + bytes(1),
        OdriveCommand.ESTIMATES: _estimates,
        OdriveCommand.TORQUES: _torques,
        OdriveCommand.TEMPERATURE: lambda self: wire.pack_pair(self._temperature, math.nan),
        OdriveCommand.SUPPLY: lambda self: wire.pack_pair(self.voltage, 3.0),
    }
