"""Twelve moteus servos as a ``JointDrive``: a servo speaks only when it is spoken to.

Each command has its own watchdog; a servo that hears nothing damps by itself and stays so until it is
stopped. In position mode its damping is limited to the share of its stiffness, so that a servo without
stiffness does not damp at all: giving way is the mode *zero velocity*.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter

from fleet import CanBus, CanFrame, LinkRefused
from fleet_quadruped.body.measured import Targets
from fleet_quadruped.can.bus_guard import Address
from fleet_quadruped.drives.answers import Answers
from fleet_quadruped.drives.asking import ask_all
from fleet_quadruped.drives.base import NEVER, Joints, Power
from fleet_quadruped.drives.moteus import frames as wire
from fleet_quadruped.drives.moteus.frames import Demand
from fleet_quadruped.drives.motor_units import Units
from fleet_quadruped.robot.busload import fd_frame_seconds
from fleet_quadruped.robot.description import DogDescription, Joint
from fleet_quadruped.robot.parts import Bus, Drive

_CALLED = {Power.ENABLED: Power.ENABLED, Power.STOPPING: Power.STOPPING, Power.DISABLED: Power.STOPPING}
"""What a servo in position mode is called, by what is wanted of it."""
_POWERS: Mapping[int, Power] = {
    wire.STOPPED: Power.DISABLED,
    wire.TIMED_OUT: Power.STOPPING,
    wire.DAMPS: Power.STOPPING,
    wire.BRAKES: Power.STOPPING,
    **dict.fromkeys(wire.STARTING, Power.STARTING),
}
_LET_GO = wire.STARTING | {wire.STOPPED}
"""Modes of a servo that was restarted; told to obey, it begins to, from wherever it believes that it is."""
_SILENT_MODES = frozenset({None, wire.STOPPED, wire.FAILED, wire.TIMED_OUT})
"""Modes in which a servo is not told to damp: it has no torque, or damps already."""
_KP, _KD, _KI = "servo.pid_position.kp", "servo.pid_position.kd", "servo.pid_position.ki"
_TIMEOUT_MODE, _TIMEOUT_TORQUE = "servo.timeout_mode", "servo.timeout_max_torque_Nm"
_COMMAND_BYTES, _REPLY_BYTES = 48, 32
_ROUNDING = 1.001


@dataclass(slots=True)
class _Servo:
    """One servo as it was last heard; times are monotonic seconds."""

    joint: Joint
    bus: CanBus
    id: int
    units: Units
    kp: float  # N m/turn of the motor, as the description wants them
    kd: float  # N m s/turn
    angle: float = 0.0
    speed: float = 0.0
    torque: float = 0.0
    mode: int | None = None
    home: int = wire.REFERS_TO_NOTHING
    code: int = 0
    temperature: float | None = None
    voltage: float | None = None
    told_at: float = NEVER
    kp_scale: float = 0.0
    kd_scale: float = 0.0
    full_kd: float = math.inf  # N m s/turn, as it is configured
    line: str = ""  # that is still to be sent
    text: bytes = b""  # that was answered
    answers: Answers = field(default_factory=Answers)
    held: bool = False  # it said that it obeys, since we wanted it
    restarted: bool = False  # it let go by itself


_VALUES = attrgetter("angle", "speed", "torque", "told_at", "temperature", "voltage", "restarted")


class MoteusDrives:
    """All servos of a dog, on the buses by their names."""

    def __init__(self, dog: DogDescription, buses: Mapping[str, CanBus], joints: Sequence[Joint]) -> None:
        self._dog = dog
        self._buses = buses
        self._servos = [self._servo(joint) for joint in joints]
        self._by_reply = {(one.joint.bus, wire.from_servo(one.id)): one for one in self._servos}
        self._by_command = {(one.joint.bus, wire.to_servo(one.id)): one for one in self._servos}
        self._timeout = dog.drive.timeout
        self._wanted = Power.DISABLED
        self._most: float | None = None  # N m

    def _servo(self, joint: Joint) -> _Servo:
        kind, square = joint.kind, joint.kind.ratio**2
        kp, kd = kind.kp / square * wire.TURN, kind.kd / square * wire.TURN
        return _Servo(joint, self._buses[joint.bus], joint.id, Units(joint), kp, kd)

    @staticmethod
    def problems(dog: DogDescription) -> list[str]:
        """Return buses that are not CAN FD."""
        used = dict.fromkeys(wiring.bus for wiring in dog.joints.values())
        return [
            f"buses.{name}: moteus needs CAN FD; give it a data_bitrate, like 5000000"
            for name in used
            if dog.buses[name].data_bitrate is None
        ]

    @staticmethod
    def load(drive: Drive, joints: int, bus: Bus) -> float:
        """Return what a command and a reply for each joint in each cycle take."""
        both = fd_frame_seconds(_COMMAND_BYTES, bus) + fd_frame_seconds(_REPLY_BYTES, bus)
        return drive.cycle_hz * joints * both

    @staticmethod
    def shared(dog: DogDescription) -> tuple[int, ...]:  # noqa: ARG004 - the same for each make
        """Return none: each servo has its own identifiers."""
        return ()

    @staticmethod
    def identifiers(drive: Drive, joint: Joint) -> tuple[int, ...]:  # noqa: ARG004 - the same for each make
        """Return its answers, and all that it takes for its own: it would obey another's frames."""
        return (*wire.heard_by(joint.id), wire.from_servo(joint.id))

    @staticmethod
    def farthest(joint: Joint, drive: Drive) -> float:  # noqa: ARG004 - the same for each make
        """Return how far its numbers are exact."""
        return wire.MOST_TURNS * wire.TURN

    @property
    def addresses(self) -> frozenset[Address]:
        """The frames to each servo."""
        return frozenset(self._by_command)

    def configure(self) -> None:
        """Check what positions refer to and the gains; have the servos damp when they hear nothing."""
        for servo in self._servos:
            servo.restarted, servo.told_at = False, NEVER
        self._ask(lambda servo: self._frame(servo, wire.pack_query()), lambda servo: servo.told_at > NEVER)
        for servo in self._servos:
            self._check_home(servo)
        kp, kd, ki = (self._get(name) for name in (_KP, _KD, _KI))
        for servo, *found in zip(self._servos, kp, kd, ki, strict=True):
            self._take_gains(servo, *found)
        self._set(_TIMEOUT_MODE, [float(wire.DAMPS)] * len(self._servos))
        self._set(_TIMEOUT_TORQUE, [one.joint.kind.torque / one.joint.kind.ratio for one in self._servos])

    def _check_home(self, servo: _Servo) -> None:
        """Refuse a position of which nobody knows what it refers to."""
        joint = servo.joint
        if servo.home == wire.REFERS_TO_NOTHING:
            raise LinkRefused(f"{joint.name}: its position refers to nothing (register 00Ch is 0): home it")
        if servo.home == wire.REFERS_TO_ROTOR and joint.kind.ratio != 1:
            raise LinkRefused(
                f"{joint.name}: its position refers to the rotor (register 00Ch is 1), and the joint "
                f"turns once for {joint.kind.ratio:g} of it: set the output's place (d exact)"
            )

    def _take_gains(self, servo: _Servo, kp: float, kd: float, ki: float) -> None:
        """Take the gains that a servo has; what is wanted is a share of them. Raises LinkRefused."""
        name, safety = servo.joint.name, self._dog.safety.kd / servo.joint.kind.ratio**2 * wire.TURN
        if ki != 0:
            raise LinkRefused(f"{name}: {_KI} is {ki:g}, wanted 0")
        if servo.kp > kp * _ROUNDING:
            raise LinkRefused(f"{name}: {_KP} is {kp:g}, wanted {servo.kp:g} or more (N m/turn)")
        most = max(servo.kd, safety)
        if servo.kp > 0:
            most = max(most, servo.kd / servo.kp * kp)  # its damping is limited to the share of its stiffness
        if most > kd * _ROUNDING:
            raise LinkRefused(f"{name}: {_KD} is {kd:g}, wanted {most:g} or more (N m s/turn)")
        servo.kp_scale = min(1.0, servo.kp / kp) if kp else 0.0
        servo.kd_scale, servo.full_kd = min(1.0, servo.kd / kd), kd

    def limit_torque(self, torque: float | None) -> None:
        """Send the limit with each command."""
        self._most = torque

    def take(self, bus: str, frame: CanFrame, now: float) -> None:
        """Take a received frame."""
        servo = self._by_reply.get((bus, frame.id))
        parts = None if servo is None else wire.unpack(frame.data)
        if servo is None or parts is None:
            return
        servo.text += b"".join(part.text for part in parts if part.kind == 0x41)
        told = wire.registers(parts)
        if wire.MODE in told and wire.FAULT in told:
            self._told(servo, told, frame.data, now)

    def _told(self, servo: _Servo, told: dict[int, float], data: bytes, now: float) -> None:
        """Take what a servo tells of itself, if they are numbers."""
        turns, speed, torque = told[wire.POSITION], told[wire.VELOCITY], told[wire.TORQUE]
        if not (math.isfinite(turns) and math.isfinite(speed) and math.isfinite(torque)):
            return
        servo.angle, servo.speed, servo.torque = servo.units.joint(
            turns * wire.TURN, speed * wire.TURN, torque
        )
        servo.mode, servo.code, servo.home = (int(told[at]) for at in (wire.MODE, wire.FAULT, wire.HOME))
        servo.voltage, servo.temperature = told[wire.VOLTAGE], told[wire.TEMPERATURE]
        servo.told_at = now
        servo.answers.take(data)
        if self._wanted is Power.DISABLED:
            servo.held = False
        elif servo.mode == wire.OBEYS:
            servo.held = True
        elif servo.held and servo.mode in _LET_GO:
            servo.restarted = True

    def target(self, bus: str, frame: CanFrame) -> tuple[Joint, float] | None:
        """Return which joint a command sends where; one without stiffness sends it nowhere."""
        servo = self._by_command.get((bus, frame.id))
        for part in (servo and wire.unpack(frame.data)) or ():
            if servo and part.kind == 0 and part.start == wire.COMMAND and part.values[3] > 0:
                return servo.joint, servo.joint.angle(part.values[0] * wire.TURN)
        return None

    def begin_cycle(self, now: float) -> None:  # noqa: ARG002 - the answers to the last commands are on their way
        """Begin a cycle; the commands of the last one were its questions."""
        for servo in self._servos:
            servo.answers.begin()

    def complete(self) -> bool:
        """Return True when each servo has answered."""
        return all(servo.answers.complete for servo in self._servos)

    def feedback(self, now: float) -> Joints:
        """Return what is known of the joints."""
        angles, speeds, torques, told, temperatures, voltages, restarted = zip(
            *map(_VALUES, self._servos), strict=True
        )
        powers, faults = zip(*map(self._power, self._servos), strict=True)
        ages = tuple([now - at for at in told])
        return Joints(angles, speeds, torques, powers, ages, temperatures, faults, voltages, restarted)

    def enable(self) -> None:
        """Ask for position mode where each servo is, without force."""
        self._wanted = Power.ENABLED
        for servo in self._servos:
            limp = Demand(math.nan, 0.0, 0.0, 0.0, 0.0, self._limit(servo), self._timeout)
            self._send(servo, wire.pack_demand(wire.OBEYS, limp))

    def write(self, targets: Targets) -> None:
        """Send targets with the gains of the description."""
        self._wanted = Power.ENABLED
        for servo, angle, speed, torque in zip(self._servos, *targets, strict=True):
            place, turning, pushed = servo.units.motor(angle, speed, torque)
            demand = Demand(
                place / wire.TURN,
                turning / wire.TURN,
                pushed,
                servo.kp_scale,
                servo.kd_scale,
                self._limit(servo),
                self._timeout,
            )
            self._send(servo, wire.pack_demand(wire.OBEYS, demand))

    def _limit(self, servo: _Servo) -> float:
        """Return the torque (N m of the motor) that a servo may use."""
        kind = servo.joint.kind
        return (kind.torque if self._most is None else min(kind.torque, self._most)) / kind.ratio

    def braking(self) -> str:
        """Return nothing: a servo that hears nothing damps."""
        return ""

    def probe(self, kd: float) -> bool:
        """Ask all servos; what holds a dog gives way."""
        self.damp(kd)
        return True

    def lower(self, targets: Targets, kd: float) -> None:  # noqa: ARG002 - damping needs no targets
        """Give way with damping."""
        self.damp(kd)

    def damp(self, kd: float) -> None:
        """Zero velocity: no stiffness, only damping. A servo without torque is only asked."""
        self._wanted = Power.STOPPING
        for servo in self._servos:
            if servo.mode in _SILENT_MODES:
                self._send(servo, wire.pack_query())
                continue
            share = min(1.0, kd / servo.joint.kind.ratio**2 * wire.TURN / servo.full_kd)
            most = servo.joint.kind.torque / servo.joint.kind.ratio
            demand = Demand(math.nan, 0.0, 0.0, 0.0, share, most, self._timeout)
            self._send(servo, wire.pack_demand(wire.DAMPS, demand))

    def quick_stop(self) -> None:
        """Damp as the description says."""
        self.damp(self._dog.safety.kd)

    def disable(self) -> None:
        """Stop: no torque. One with a fault has none, and is only asked: a stop would clear its fault."""
        self._wanted = Power.DISABLED
        for servo in self._servos:
            off = servo.mode in {wire.FAILED, wire.STOPPED}
            self._send(servo, wire.pack_query() if off else wire.pack_mode(wire.STOPPED))

    def reset_fault(self) -> None:
        """Clear faults."""
        for servo in self._servos:
            self._send(servo, wire.pack_mode(wire.STOPPED))

    def _power(self, servo: _Servo) -> tuple[Power, str]:
        """Return what a servo is doing, and its fault."""
        number, mode = servo.joint.id, servo.mode
        if servo.told_at == NEVER or mode is None:
            return Power.ABSENT, ""
        fault = ""
        if mode == wire.FAILED:
            fault = f"{wire.FAULTS.get(servo.code, 'fault')} (register 00Fh is {servo.code})"
        elif servo.answers.doubled:
            fault = f"two drives answer as id {number} on bus {servo.joint.bus}: give each its own"
        elif servo.restarted:
            fault = f"id {number} let go by itself (mode 0); it is configured again after a reset"
        elif mode != wire.OBEYS and mode not in _POWERS:
            fault = f"id {number} is in mode {mode}, which we did not ask for"
        if fault:
            return Power.FAULT, fault
        return (_CALLED[self._wanted] if mode == wire.OBEYS else _POWERS[mode]), ""

    def _get(self, name: str) -> list[float]:
        """Return a configured value of each servo; raises LinkRefused for what is no number."""
        return [
            _number(servo, name, text)
            for servo, text in zip(self._servos, self._lines([f"conf get {name}\n"]), strict=True)
        ]

    def _set(self, name: str, values: Sequence[float]) -> None:
        """Set a value of each servo until power-off, and read it back; raises LinkRefused."""
        self._lines([f"conf set {name} {value:g}\n" for value in values])
        for servo, wanted, actual in zip(self._servos, values, self._get(name), strict=True):
            if not math.isclose(actual, wanted, rel_tol=1e-3):
                raise LinkRefused(f"{servo.joint.name}: {name} is {actual:g}, wanted {wanted:g}")

    def _lines(self, lines: list[str]) -> list[str]:
        """Send each servo a line of its diagnostics (or all the same one); return what they answer."""
        for number, servo in enumerate(self._servos):
            servo.line, servo.text = lines[number % len(lines)], b""
        self._ask(self._next_line, lambda servo: servo.text.endswith(b"\n"))
        return [servo.text.decode("ascii", "replace").splitlines()[-1] for servo in self._servos]

    def _next_line(self, servo: _Servo) -> CanFrame:
        """Return a servo's line; once sent, only the question for its answer: twice is answered twice."""
        line, servo.line = servo.line, ""
        return self._frame(servo, wire.pack_text(line))

    def _send(self, servo: _Servo, data: bytes) -> None:
        servo.bus.send(self._frame(servo, data))

    @staticmethod
    def _frame(servo: _Servo, data: bytes) -> CanFrame:
        return CanFrame(wire.to_servo(servo.id), data, fd=True)

    def _ask(self, question: Callable[[_Servo], CanFrame], answered: Callable[[_Servo], bool]) -> None:
        ask_all(self._servos, self._buses, self.take, question, answered)


def _number(servo: _Servo, name: str, text: str) -> float:
    """Return an answer as a number; raises LinkRefused."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise LinkRefused(f"{servo.joint.name}: {name} is {text!r}, which is no number")
    return value
