"""Simulated CiA 402 drive: SDO server, state machine, PDOs, heartbeat, emergency, watchdog."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping
from types import MappingProxyType

from fleet import CanFrame
from fleet_quadruped.drives.cia402 import frames as wire
from fleet_quadruped.drives.cia402.states import FOLLOWS, DriveState
from fleet_quadruped.robot.busload import SLOW_EVERY
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.parts import Drive
from fleet_quadruped.sim.brakes import DAMPING, STIFF, release
from fleet_quadruped.sim.cia402_dictionary import ERROR_BEHAVIOUR, Cia402Dictionary, DriveConfiguration
from fleet_quadruped.sim.cia402_power import PowerStage
from fleet_quadruped.sim.drive import COOL, STUBBORN, WARMING, Hears, SimEncoder
from fleet_quadruped.sim.sensors import FULL
from fleet_quadruped.sim.world import SimMotor

_STATUS: Mapping[DriveState, int] = MappingProxyType(
    {
        DriveState.NOT_READY: 0x0000,
        DriveState.SWITCH_ON_DISABLED: 0x0250,
        DriveState.READY: 0x0231,
        DriveState.SWITCHED_ON: 0x0233,
        DriveState.ENABLED: 0x1237,
        DriveState.QUICK_STOP: 0x0217,
        DriveState.FAULT_REACTION: 0x021F,
        DriveState.FAULT: 0x0218,
    }
)
_AFTER_ERROR: Mapping[int, int] = MappingProxyType({0: wire.PRE_OPERATIONAL, 2: wire.STOPPED})
"""1029h:1: NMT state after a communication error; 1 is no change."""
_NMT: Mapping[int, int] = MappingProxyType(
    {0x01: wire.OPERATIONAL, 0x02: wire.STOPPED, 0x80: wire.PRE_OPERATIONAL}
)
_SOON = 1e-6  # s beyond a timeout
_CODES: Mapping[str, int] = MappingProxyType({"overcurrent": 0x2310, "hot": 0x4310})


class SimDrive:
    """One drive at one joint; ``send`` sends its frames."""

    def __init__(self, joint: Joint, motor: SimMotor, send: Callable[[CanFrame], None], drive: Drive) -> None:
        self.joint = joint
        self.motor = motor
        self.encoder = SimEncoder(motor)
        self._units = wire.CountUnits(joint)
        self._send = send
        self._warm_since: float | None = None
        self._scale = drive.temperature.scale if drive.temperature else None
        self.sdo = Cia402Dictionary(joint, drive, send)
        self.power = PowerStage(motor, self.sdo.objects)
        self.nmt = wire.PRE_OPERATIONAL
        self._muted = self._terse = self._ignores_commands = False
        self.voltage = FULL
        self._code = 0
        self._waiting: tuple[int, float, float] | None = None  # control word, angle, torque
        self._from = self._to = motor.angle
        self._feed = 0.0
        self._move_began = 0.0  # start of the interpolation from _from to _to, s
        self._time = 0.0
        self._look_at = 0.0
        self._next_beat = math.inf
        self._config = DriveConfiguration()
        self._master_at: float | None = None
        self._syncs = 0
        self.hears: Mapping[int, Hears] = {
            0x000: self._command,
            wire.SYNC: self._sync,
            wire.HEARTBEAT + wire.MASTER: self._master,
            wire.RPDO1 + joint.id: self._target,
            wire.SDO_REQUEST + joint.id: self.sdo.handle_frame,
        }
        self.boot()

    @property
    def state(self) -> DriveState:
        """State in the CiA 402 state machine."""
        return self.power.state

    def boot(self) -> None:
        """Start as after power-on."""
        self.power.boot()
        self.nmt = wire.PRE_OPERATIONAL
        self._master_at = self._waiting = None
        self._say(wire.HEARTBEAT, bytes([wire.BOOT_UP]))

    def fail(self, why: str) -> None:
        """Enter the fault state, and send an emergency."""
        self._code = _CODES[why]
        self.power.fail()
        self._say(wire.EMERGENCY, struct.pack("<HB5x", self._code, 0x21))

    def mute(self) -> None:
        """Send and receive nothing any more."""
        self._muted, self.hears = True, {}

    def cut_short(self) -> None:
        """Fail, with an emergency of only two bytes."""
        self._terse = True
        self.fail("overcurrent")

    def ignore(self) -> None:
        """Ignore targets; bit 12 of the status word shows it."""
        self._ignores_commands = True

    def warm(self) -> None:
        """Heat up without end."""
        self._warm_since = self._time

    def doze(self) -> None:
        """Ignore the first few commands to enable operation."""
        self.power.dozing = STUBBORN

    def pretend(self) -> None:
        """Identify as an I/O module."""
        self.sdo.pretend()

    def refuse(self) -> None:
        """Refuse the first entry of the target PDO's mapping."""
        self.sdo.refuse()

    def control(self, dt: float) -> None:
        """Set the motor for the next ``dt`` seconds; serve watchdog and heartbeat."""
        if self._time >= self._look_at or self.sdo.changed:
            self._poll()
        left = self._move_began + self._config.cycle - self._time  # s of interpolation
        self._time += dt
        motor = self.motor
        self.encoder.follow()
        if self.power.slow_down(dt):
            return
        if self.state is not DriveState.ENABLED:
            release(motor)
            return
        goal, target, slope = self._to, self._to, 0.0
        if left > _SOON:
            target -= (goal - self._from) * left / self._config.cycle
            slope = (goal - target) / max(left, dt)
        reach = self._config.reach
        if reach < math.inf:
            target = max(motor.angle - reach, min(motor.angle + reach, target))
        motor.kp, motor.kd, motor.feed = STIFF, DAMPING, self._feed
        motor.target, motor.target_speed, motor.slope = target, slope, slope

    def _poll(self) -> None:
        """Serve watchdog and heartbeat, and apply a changed configuration."""
        if self.sdo.changed:
            self.sdo.changed = False
            self._config = self.sdo.configuration()
            self._next_beat = min(self._next_beat, self._time + self._config.beat)
        if self._master_at is not None and self._time - self._master_at > self._config.timeout:
            self._stop_alone()
        if self._time >= self._next_beat:
            self._next_beat = self._time + self._config.beat
            self._say(wire.HEARTBEAT, bytes([self.nmt]))
        silent = math.inf if self._master_at is None else self._master_at + self._config.timeout + _SOON
        self._look_at = min(self._next_beat, silent)

    def _stop_alone(self) -> None:
        """Stop because the master's heartbeat is missing (1016h, 6007h)."""
        self._master_at = self._waiting = None
        self._say(wire.EMERGENCY, struct.pack("<HB5x", wire.OUR_SILENCE, 0x11))
        self.power.lose_connection()
        behaviour = self.sdo.objects.get(ERROR_BEHAVIOUR)
        self.nmt = _AFTER_ERROR.get(behaviour.value if behaviour else 0, self.nmt)

    def _master(self, _frame: CanFrame) -> None:
        """Process the master's heartbeat."""
        if self._master_at is None:
            self._look_at = self._time
        self._master_at = self._time

    def _target(self, frame: CanFrame) -> None:
        """Store a control word and a target until the next SYNC."""
        self._waiting = self._units.unpack(frame.data) if self.nmt == wire.OPERATIONAL else None

    def _command(self, frame: CanFrame) -> None:
        """Execute an NMT command."""
        data = frame.data
        if len(data) < 2 or data[1] not in {0, self.joint.id}:
            return
        command = data[0]
        if command in {0x81, 0x82}:
            self.boot()
        else:
            self.nmt = _NMT.get(command, self.nmt)
            if self.nmt != wire.OPERATIONAL:
                self.power.lose_connection()

    def _sync(self, _frame: CanFrame) -> None:
        """Apply the target received since the last SYNC, and send the feedback."""
        if self.nmt != wire.OPERATIONAL:
            return
        if self._waiting is not None:
            self._obey(self._waiting)
            self._waiting = None
        motor, status = self.motor, _STATUS[self.state]
        if self._ignores_commands:
            status &= ~FOLLOWS
        torque = None if self.sdo.unmappable else motor.torque
        self._say(wire.TPDO1, self._units.pack(status, self.encoder.angle, torque))
        self._syncs += 1
        if self._syncs % SLOW_EVERY == 0:
            warm = COOL + (self._time - self._warm_since) * WARMING if self._warm_since is not None else COOL
            heat = None if self._scale is None else round(warm / self._scale)
            self._say(wire.TPDO2, wire.pack_slow(wire.SlowPdo(self.voltage, self._code, heat)))

    def _obey(self, decoded: tuple[int, float, float]) -> None:
        """Apply a control word and a target."""
        control, angle, torque = decoded
        was = self.state
        if not self.power.handle_control_word(control):
            return
        if self.state is DriveState.ENABLED is not was:
            self._to = self.motor.angle
        if was is DriveState.FAULT is not self.state:
            self._code = 0
            self._say(wire.EMERGENCY, bytes(8))
        if self.state is DriveState.ENABLED and not self._ignores_commands:
            self._from = self._to
            self._to = angle - self.encoder.off
            self._feed = torque
            self._move_began = self._time

    def _say(self, base: int, data: bytes) -> None:
        """Send a frame."""
        if not self._muted:
            short = self._terse and base == wire.EMERGENCY
            self._send(CanFrame(base + self.joint.id, data[:2] if short else data))
