"""A simulated CiA 402 drive: SDO server, state machine, PDOs, heartbeat, emergency, watchdog."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping
from types import MappingProxyType

from fleet import CanFrame
from fleet_quadruped.drives.cia402 import frames as wire
from fleet_quadruped.drives.cia402.setup import MAX_TORQUE, MODE_DISPLAY, OPTIONAL, mapping_objects
from fleet_quadruped.drives.cia402.states import FOLLOWS, DriveState
from fleet_quadruped.robot.busload import SLOW_EVERY
from fleet_quadruped.robot.description import Joint
from fleet_quadruped.robot.parts import Drive
from fleet_quadruped.sim.brakes import (
    DAMPING,
    DISABLE_OPTION,
    DISABLES,
    FAULT_OPTION,
    FAULTS,
    QUICK_STOP_OPTION,
    QUICK_STOPS,
    STIFF,
    BrakeEnd,
    MotorBrake,
    let_go,
)
from fleet_quadruped.sim.drive import COOL, STUBBORN, WARMING, Hears, SimEncoder
from fleet_quadruped.sim.sdo import Entry, SdoServer
from fleet_quadruped.sim.sensors import FULL
from fleet_quadruped.sim.world import Motor

_NO_LIMIT = 0xFFFF  # in 6072h
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
_STEPS: Mapping[tuple[DriveState, int], DriveState] = MappingProxyType(
    {
        (DriveState.SWITCH_ON_DISABLED, 0x06): DriveState.READY,
        (DriveState.READY, 0x07): DriveState.SWITCHED_ON,
        (DriveState.SWITCHED_ON, 0x0F): DriveState.ENABLED,
        (DriveState.SWITCHED_ON, 0x06): DriveState.READY,
        (DriveState.ENABLED, 0x06): DriveState.READY,
    }
)
"""(state, low four bits of the control word) to the next state; clear bit 1 means voltage off; see _ACTS."""
_FAILED = frozenset({DriveState.FAULT, DriveState.FAULT_REACTION})
_CONNECTION_LOST = (0x6007, 0)
_ERROR_BEHAVIOUR = (0x1029, 1)
_AFTER_ERROR: Mapping[int, int] = MappingProxyType({0: wire.PRE_OPERATIONAL, 2: wire.STOPPED})
"""1029h:1: the NMT state of a node after a communication error; 1 leaves it as it is."""
_NMT: Mapping[int, int] = MappingProxyType(
    {0x01: wire.OPERATIONAL, 0x02: wire.STOPPED, 0x80: wire.PRE_OPERATIONAL}
)
_SOON = 1e-6  # s beyond a time-out
_CODES: Mapping[str, int] = MappingProxyType({"overcurrent": 0x2310, "hot": 0x4310})


class SimDrive:
    """One drive at one joint; ``send`` puts its frames on the bus."""

    def __init__(self, joint: Joint, motor: Motor, send: Callable[[CanFrame], None], drive: Drive) -> None:
        self.joint = joint
        self.motor = motor
        self.encoder = SimEncoder(motor)
        self._units = wire.Units(joint)
        self._send = send
        self._warm_since: float | None = None
        self._scale = drive.temperature.scale if drive.temperature else None
        self.sdo = SdoServer(joint.id, _dictionary(joint, drive), send)
        self.sdo.objects[MODE_DISPLAY] = self.sdo.objects[0x6060, 0]
        self.state = DriveState.SWITCH_ON_DISABLED
        self.nmt = wire.PRE_OPERATIONAL
        self._brake: MotorBrake | None = None
        self._after_brake = DriveState.SWITCH_ON_DISABLED
        self._stays = False  # it does not go on from a quick stop
        self._muted = self._terse = self._deaf = False
        self._dozing = 0  # times that it does not hear that it is to be enabled
        self.voltage = FULL
        self._code = 0
        self._control = 0
        self._waiting: tuple[int, float, float] | None = None  # control word, angle, torque
        self._from = self._to = motor.angle
        self._feed = 0.0
        self._begun = 0.0  # when the way from _from to _to began
        self._time = 0.0
        self._look_at = 0.0
        self._next_beat = self._beat = self._timeout = self._reach = math.inf
        self._cycle = 0.001  # s, of interpolation
        self._master_at: float | None = None
        self._syncs = 0
        self.hears: Mapping[int, Hears] = {
            0x000: self._command,
            wire.SYNC: self._sync,
            wire.HEARTBEAT + wire.MASTER: self._master,
            wire.RPDO1 + joint.id: self._target,
            wire.SDO_REQUEST + joint.id: self.sdo.take,
        }
        self.boot()

    def boot(self) -> None:
        """Start as after power-on."""
        self.state, self.nmt = DriveState.SWITCH_ON_DISABLED, wire.PRE_OPERATIONAL
        self._master_at = self._waiting = self._brake = None
        self._say(wire.HEARTBEAT, bytes([wire.BOOT_UP]))

    def fail(self, why: str) -> None:
        """Go into fault, and say so in an emergency."""
        self._code = _CODES[why]
        self._stop(DriveState.FAULT_REACTION, FAULTS[self.sdo.objects[FAULT_OPTION].value], DriveState.FAULT)
        self._say(wire.EMERGENCY, struct.pack("<HB5x", self._code, 0x21))

    def mute(self) -> None:
        """Say and hear nothing any more."""
        self._muted, self.hears = True, {}

    def cut_short(self) -> None:
        """Fail, and say so in an emergency of two bytes."""
        self._terse = True
        self.fail("overcurrent")

    def stay(self) -> None:
        """Stay in quick stop, whatever it is told, until its voltage is disabled (no transition 16)."""
        self._stays = True

    def ignore(self) -> None:
        """Ignore targets, as a drive does that has its own reasons."""
        self._deaf = True

    def keep_mode(self) -> None:
        """Stay in the mode it is in."""
        self.sdo.objects[MODE_DISPLAY] = Entry(1, 1)

    def warm(self) -> None:
        """Become warmer, for good."""
        self._warm_since = self._time

    def doze(self) -> None:
        """Miss the first few times that it is to be enabled."""
        self._dozing = STUBBORN

    def pretend(self) -> None:
        """Be an I/O module."""
        self.sdo.objects[0x1000, 0].value = 0x0003_0191

    def be_plain(self) -> None:
        """Have neither torque offset (60B2h) nor torque (6077h)."""
        del self.sdo.objects[0x60B2, 0], self.sdo.objects[0x6077, 0]
        self.sdo.unmappable = frozenset(OPTIONAL)

    def be_simple(self) -> None:
        """Have no object for what follows a communication error (1029h): then it leaves operation."""
        del self.sdo.objects[_ERROR_BEHAVIOUR]

    def refuse(self) -> None:
        """Refuse the first entry of the target PDO's mapping."""
        self.sdo.refusals[0x1600, 1] = 0x06040041

    def control(self, dt: float) -> None:
        """Set the motor for the next ``dt`` seconds, and look after the watchdog and the heartbeat."""
        if self._time >= self._look_at or self.sdo.changed:
            self._look()
        left = self._begun + self._cycle - self._time  # s of interpolation
        self._time += dt
        motor = self.motor
        self.encoder.follow()
        if self._brake is not None:
            self._slow_down(self._brake, dt)
            return
        if self.state is not DriveState.ENABLED:
            let_go(motor)
            return
        goal, target, slope = self._to, self._to, 0.0
        if left > _SOON:
            target -= (goal - self._from) * left / self._cycle
            slope = (goal - target) / max(left, dt)
        if self._reach < math.inf:
            target = max(motor.angle - self._reach, min(motor.angle + self._reach, target))
        motor.kp, motor.kd, motor.feed = STIFF, DAMPING, self._feed
        motor.target, motor.target_speed, motor.slope = target, slope, slope

    def _stop(self, state: DriveState, ending: BrakeEnd, after: DriveState) -> None:
        """Begin to stop in ``state``; ``after`` is what follows when the torque is off."""
        self.state, self._after_brake = state, after
        self._brake = MotorBrake(ending, self.motor)
        if not self._brake.torque:
            self.state, self._brake = after, None

    def _slow_down(self, brake: MotorBrake, dt: float) -> None:
        """Go on with a stop: brake, then hold, or take the torque off."""
        if brake.over and not brake.holds:
            self.state, self._brake = self._after_brake, None
            let_go(self.motor)
        else:
            brake.step(self.motor, dt)

    def _look(self) -> None:
        """Look after the watchdog and the heartbeat, and what was configured."""
        if self.sdo.changed:
            self._configure()
        if self._master_at is not None and self._time - self._master_at > self._timeout:
            self._stop_alone()
        if self._time >= self._next_beat:
            self._next_beat = self._time + self._beat
            self._say(wire.HEARTBEAT, bytes([self.nmt]))
        silent = math.inf if self._master_at is None else self._master_at + self._timeout + _SOON
        self._look_at = min(self._next_beat, silent)

    def _configure(self) -> None:
        """Take what was written into the object dictionary."""
        self.sdo.changed = False
        value = {place: entry.value for place, entry in self.sdo.objects.items()}
        self._timeout = (value[0x1016, 1] & 0xFFFF) / 1000 or math.inf
        self._beat = value[0x1017, 0] / 1000 or math.inf
        self._next_beat = min(self._next_beat, self._time + self._beat)
        limit = value.get(MAX_TORQUE, _NO_LIMIT)
        self._reach = math.inf if limit == _NO_LIMIT else limit / 1000 * self.joint.kind.rated_torque / STIFF
        exponent = value[0x60C2, 2]
        self._cycle = value[0x60C2, 1] * 10.0 ** (exponent - 256 if exponent > 127 else exponent)

    def _stop_alone(self) -> None:
        """Stop by ourselves because the master's heartbeat is missing (1016h, 6007h)."""
        self._master_at = self._waiting = None
        self._say(wire.EMERGENCY, struct.pack("<HB5x", wire.OUR_SILENCE, 0x11))
        self._lose_connection()
        behaviour = self.sdo.objects.get(_ERROR_BEHAVIOUR)
        self.nmt = _AFTER_ERROR.get(behaviour.value if behaviour else 0, self.nmt)

    def _lose_connection(self) -> None:
        """Do what 6007h says, when the master is silent or takes the node out of operation."""
        if self.state is not DriveState.ENABLED:
            return
        option = self.sdo.objects[_CONNECTION_LOST].value
        if option == 1:
            self._stop(
                DriveState.FAULT_REACTION, FAULTS[self.sdo.objects[FAULT_OPTION].value], DriveState.FAULT
            )
        elif option == 2:
            self._switch(0x00, self._control)
        elif option == 3:
            self.stop_quickly()

    def stop_quickly(self) -> None:
        """Do what 605Ah says for a quick stop."""
        ending = QUICK_STOPS[self.sdo.objects[QUICK_STOP_OPTION].value]
        self._stop(DriveState.QUICK_STOP, ending, DriveState.SWITCH_ON_DISABLED)

    def _master(self, _frame: CanFrame) -> None:
        """Note that the master lives."""
        if self._master_at is None:
            self._look_at = self._time
        self._master_at = self._time

    def _target(self, frame: CanFrame) -> None:
        """Keep a control word and a target for the next SYNC."""
        self._waiting = self._units.unpack(frame.data) if self.nmt == wire.OPERATIONAL else None

    def _command(self, frame: CanFrame) -> None:
        """Obey NMT."""
        data = frame.data
        if len(data) < 2 or data[1] not in {0, self.joint.id}:
            return
        command = data[0]
        if command in {0x81, 0x82}:
            self.boot()
        else:
            self.nmt = _NMT.get(command, self.nmt)
            if self.nmt != wire.OPERATIONAL:
                self._lose_connection()

    def _sync(self, _frame: CanFrame) -> None:
        """Obey the target that came since the last SYNC, and tell where we are."""
        if self.nmt != wire.OPERATIONAL:
            return
        if self._waiting is not None:
            self._obey(self._waiting)
            self._waiting = None
        motor, status = self.motor, _STATUS[self.state]
        if self._deaf:
            status &= ~FOLLOWS
        torque = None if self.sdo.unmappable else motor.torque
        self._say(wire.TPDO1, self._units.pack(status, self.encoder.angle, torque))
        self._syncs += 1
        if self._syncs % SLOW_EVERY == 0:
            warm = COOL + (self._time - self._warm_since) * WARMING if self._warm_since is not None else COOL
            heat = None if self._scale is None else round(warm / self._scale)
            self._say(wire.TPDO2, wire.pack_slow(wire.SlowPdo(self.voltage, self._code, heat)))

    def _obey(self, told: tuple[int, float, float]) -> None:
        """Take a control word and a target."""
        control, angle, torque = told
        if self._dozing and control & 0x0F == 0x0F and self.state is DriveState.SWITCHED_ON:
            self._dozing -= 1
            return
        if control != self._control or self.state is not DriveState.ENABLED:  # enabled, it obeys a word once
            self._switch(control, self._control)
        if self.state is DriveState.ENABLED and not self._deaf:
            self._from = self._to
            self._to = angle - self.encoder.off
            self._feed = torque
            self._begun = self._time

    def _switch(self, control: int, before: int) -> None:
        """Change the state as a control word tells."""
        self._control = control
        was, act = self.state, _ACTS.get((self.state, control & 0x0F))
        if self.state in _FAILED:
            self._reset(control, before)
        elif not control & 0x02:
            self.state, self._brake = DriveState.SWITCH_ON_DISABLED, None
        elif act is not None:
            act(self)
        else:
            self.state = _STEPS.get((self.state, control & 0x0F), self.state)
        if self.state is DriveState.ENABLED is not was:
            self._to = self.motor.angle

    def _reset(self, control: int, before: int) -> None:
        """Leave a fault by a rising edge of the reset bit."""
        if self.state is DriveState.FAULT and control & 0x80 and not before & 0x80:
            self.state, self._code = DriveState.SWITCH_ON_DISABLED, 0
            self._say(wire.EMERGENCY, bytes(8))

    def disable(self) -> None:
        """Do what 605Ch says for "disable operation"."""
        self._stop(
            DriveState.ENABLED, DISABLES[self.sdo.objects[DISABLE_OPTION].value], DriveState.SWITCHED_ON
        )

    def go_on(self) -> None:
        """Go on from a quick stop that holds (605Ah is 5 to 7): transition 16."""
        if self._brake is not None and self._brake.holds and not self._stays:
            self.state, self._brake = DriveState.ENABLED, None

    def _say(self, base: int, data: bytes) -> None:
        """Send a frame of ours."""
        if not self._muted:
            short = self._terse and base == wire.EMERGENCY
            self._send(CanFrame(base + self.joint.id, data[:2] if short else data))


_ACTS: Mapping[tuple[DriveState, int], Callable[[SimDrive], None]] = MappingProxyType(
    {
        (DriveState.ENABLED, 0x02): SimDrive.stop_quickly,
        (DriveState.ENABLED, 0x07): SimDrive.disable,
        (DriveState.QUICK_STOP, 0x0F): SimDrive.go_on,
    }
)
"""(state, low four bits of the control word) to what takes its time, or is not always possible."""


def _dictionary(joint: Joint, drive: Drive) -> dict[tuple[int, int], tuple[int, int]]:
    """Return the drive's objects: (index, sub) to (bytes, value)."""
    objects = {
        (0x1000, 0): (4, 0x0002_0192),
        (0x1001, 0): (1, 0),
        (0x1018, 1): (4, 0x00F1EE70),
        (0x1018, 2): (4, 0x0402),
        (0x6502, 0): (4, 0x80),
        (0x1016, 1): (4, 0),
        (0x1017, 0): (2, 0),
        (0x6007, 0): (2, 0),
        QUICK_STOP_OPTION: (2, 2),
        DISABLE_OPTION: (2, 1),
        FAULT_OPTION: (2, 2),
        _ERROR_BEHAVIOUR: (1, 0),
        (0x60C2, 1): (1, 1),
        (0x60C2, 2): (1, 0xFD),
        (0x6060, 0): (1, 0),
        MAX_TORQUE: (2, _NO_LIMIT),
        (0x60B2, 0): (2, 0),
        (0x6077, 0): (2, 0),
    }
    objects.update({(item.place, item.sub): (item.size, 0) for item in mapping_objects(drive, joint.id)})
    return objects
