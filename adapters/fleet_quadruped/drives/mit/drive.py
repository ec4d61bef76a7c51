"""Twelve MIT motors as a ``JointDrive``: a motor speaks only when it is spoken to."""

from __future__ import annotations

import logging
import math
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter

from fleet import CanBus, CanFrame, LinkRefused
from fleet_quadruped.body.measured import Targets
from fleet_quadruped.can.bus_guard import Address
from fleet_quadruped.drives.answers import Answers
from fleet_quadruped.drives.asking import ask_all
from fleet_quadruped.drives.base import NEVER, Joints, Power
from fleet_quadruped.drives.mit import frames as wire
from fleet_quadruped.drives.mit.frames import MitCommand
from fleet_quadruped.drives.mit.profiles import PROFILES, MotorProfile, profile_name, profile_of
from fleet_quadruped.drives.motor_units import Units, near
from fleet_quadruped.robot.busload import frame_bits
from fleet_quadruped.robot.description import DogDescription, Joint
from fleet_quadruped.robot.parts import Bus, Drive

log = logging.getLogger(__name__)

_TOLD = {Power.ENABLED: Power.ENABLED, Power.STOPPING: Power.STOPPING, Power.DISABLED: Power.STOPPING}
"""What an enabled motor is called, by what is wanted of it: it is not off before it says so."""
_NAMES = ("PMAX", "VMAX", "TMAX")


@dataclass(slots=True)
class _Motor:
    """One motor as it was last heard."""

    joint: Joint
    bus: CanBus
    id: int
    units: Units
    profile: MotorProfile
    layout: wire.Layout
    gains: int  # those of the description, as they are in a command
    angle: float = 0.0
    speed: float = 0.0
    torque: float = 0.0
    status: int | None = None
    temperature: float | None = None
    told_at: float = NEVER
    answers: Answers = field(default_factory=Answers)
    enabled: bool = False  # we asked for it
    unknown: bool = True  # nobody has told it to be off or on yet: one that says no status may hold
    answered: bool = False  # since it was asked to be enabled
    held: bool = False  # a Damiao motor that said it is enabled, since we wanted it
    restarted: bool = False  # it let go by itself, so its watchdog is not trusted any more


_VALUES = attrgetter("angle", "speed", "torque", "told_at", "temperature", "restarted")


class MitDrives:
    """All motors of a dog, on the buses by their names."""

    def __init__(self, dog: DogDescription, buses: Mapping[str, CanBus], joints: Sequence[Joint]) -> None:
        self._dog = dog
        self._buses = buses
        self._layouts: dict[MotorProfile, wire.Layout] = {}
        self._motors = [self._motor(joint) for joint in joints]
        self._damiao = [motor for motor in self._motors if motor.profile.damiao]
        self._plain = [motor for motor in self._motors if not motor.profile.damiao]
        self._by_id = {(motor.joint.bus, motor.joint.id): motor for motor in self._motors}
        self._by_reply = {(motor.joint.bus, wire.MASTER + motor.joint.id): motor for motor in self._damiao}
        self._by_number = {(motor.joint.bus, motor.joint.id): motor for motor in self._plain}
        self._registers: dict[tuple[str, int, int], bytes] = {}
        self._wanted = Power.DISABLED
        self._most: float | None = None  # N m

    def _motor(self, joint: Joint) -> _Motor:
        kind = joint.kind
        profile = profile_of(self._dog.drive, kind)
        layout = self._layouts.setdefault(profile, wire.Layout(profile))
        gains = layout.pack_gains(kind.kp / kind.ratio**2, kind.kd / kind.ratio**2)
        return _Motor(joint, self._buses[joint.bus], joint.id, Units(joint), profile, layout, gains)

    @staticmethod
    def problems(dog: DogDescription) -> list[str]:
        """Return motors that are not known, and those that are described although they are."""
        drive = dog.drive
        again = sorted(set(drive.profiles) & set(PROFILES))
        found = [f"drive.profiles: {name} is built in; give yours another name" for name in again]
        known = ", ".join(sorted({*PROFILES, *drive.profiles}))
        unknown: dict[str, str] = {}
        for part, kind in dog.actuators.items():
            name = profile_name(drive, kind)
            if name not in PROFILES and name not in drive.profiles:
                place = f"actuators.{part}.profile" if kind.profile else "drive.profile"
                unknown[place] = (
                    f"{place}: there is no {name!r}; there are {known}, or describe it in profiles"
                )
        return [*found, *unknown.values()]

    @staticmethod
    def load(drive: Drive, joints: int, bus: Bus) -> float:
        """Return what a command and a reply for each joint in each cycle take."""
        return drive.cycle_hz * joints * 2 * frame_bits(8) / bus.bitrate

    @staticmethod
    def shared(dog: DogDescription) -> tuple[int, ...]:
        """Return Damiao's registers, and where the others answer."""
        kinds = {profile_of(dog.drive, kind).damiao for kind in dog.actuators.values()}
        return tuple(wire.REGISTERS if damiao else 0 for damiao in sorted(kinds))

    @staticmethod
    def identifiers(drive: Drive, joint: Joint) -> tuple[int, ...]:
        """Return where a motor hears, and where a Damiao motor answers."""
        damiao = profile_of(drive, joint.kind).damiao
        return (joint.id, wire.MASTER + joint.id) if damiao else (joint.id,)

    @staticmethod
    def farthest(joint: Joint, drive: Drive) -> float:
        """Return the range of the profile."""
        return profile_of(drive, joint.kind).angle

    @property
    def addresses(self) -> frozenset[Address]:
        """Each motor's own identifier."""
        return frozenset(self._by_id)

    def configure(self) -> None:
        """Check that all motors answer; of Damiao motors also the ranges, and set their watchdog."""
        for motor in self._motors:
            motor.restarted = False
        if self._plain:
            names = sorted({profile_name(self._dog.drive, motor.joint.kind) for motor in self._plain})
            log.warning(
                "%s: no watchdog that can be set over CAN; check it in the maker's tool", ", ".join(names)
            )
            kd = self._dog.safety.kd
            self._ask(
                self._plain,
                lambda motor: CanFrame(motor.id, self._giving_way(motor, kd)),
                lambda motor: motor.told_at > NEVER,
            )
        if self._damiao:
            self._configure_damiao()

    def _configure_damiao(self) -> None:
        """Check the ranges, and set the watchdog."""
        for register in wire.RANGE_REGISTERS:
            self._read(register)
        self._check_ranges()
        timeout = wire.timeout_value(self._dog.drive.timeout)
        self._ask(
            self._damiao,
            lambda motor: CanFrame(
                wire.REGISTERS, wire.write_register(motor.id, wire.TIMEOUT_REGISTER, timeout)
            ),
            lambda motor: self._register(motor, wire.TIMEOUT_REGISTER) is not None,
        )
        self._registers = {
            key: value for key, value in self._registers.items() if key[2] != wire.TIMEOUT_REGISTER
        }
        self._read(wire.TIMEOUT_REGISTER)
        for motor in self._damiao:
            actual = self._register(motor, wire.TIMEOUT_REGISTER)
            if actual != timeout:
                raise LinkRefused(f"{motor.joint.name}: register 9 (watchdog) is {actual!r}, not {timeout!r}")

    def limit_torque(self, torque: float | None) -> None:
        """Keep targets so near that the motors' own stiffness pushes no harder."""
        self._most = torque

    def take(self, bus: str, frame: CanFrame, now: float) -> None:
        """Take a received frame."""
        data = frame.data
        motor = self._by_reply.get((bus, frame.id))
        if motor is not None and (told := wire.unpack_register(data)) and told[0] == motor.id:
            self._registers[bus, told[0], told[1]] = told[2]
            return
        if motor is None and frame.id == 0 and data:
            motor = self._by_number.get((bus, data[0]))
        if motor is None:
            return
        reply = motor.layout.unpack_reply(data)
        if reply is None:
            return
        _, angle, speed, torque, motor.status, motor.temperature = reply
        motor.angle, motor.speed, motor.torque = motor.units.joint(angle, speed, torque)
        motor.told_at, motor.answered = now, True
        motor.answers.take(data)
        self._note_hold(motor)

    def target(self, bus: str, frame: CanFrame) -> tuple[Joint, float] | None:
        """Return which joint a command sends where; one without stiffness sends it nowhere."""
        motor = self._by_id.get((bus, frame.id))
        command = None if motor is None else motor.layout.unpack_command(frame.data)
        if motor is None or command is None or frame.data in wire.SPECIAL:
            return None
        angle, _, kp, *_ = command
        return (motor.joint, motor.joint.angle(angle)) if kp else None

    def _note_hold(self, motor: _Motor) -> None:
        """Notice a motor that lets go although nobody told it to."""
        if self._wanted is Power.DISABLED:
            motor.held = False
        elif motor.status == wire.ENABLED:
            motor.held = True
        elif motor.status == wire.DISABLED and motor.held:
            motor.restarted = True

    def begin_cycle(self, now: float) -> None:  # noqa: ARG002 - the answers to the last commands are on their way
        """Begin a cycle; the commands of the last one were its questions."""
        for motor in self._motors:
            motor.answers.begin()

    def complete(self) -> bool:
        """Return True when each motor has answered."""
        return all(motor.answers.complete for motor in self._motors)

    def feedback(self, now: float) -> Joints:
        """Return what is known of the joints."""
        angles, speeds, torques, told, temperatures, restarted = zip(*map(_VALUES, self._motors), strict=True)
        powers, faults = zip(*map(self._power, self._motors), strict=True)
        ages = tuple([now - at for at in told])
        voltages = (None,) * len(ages)
        return Joints(angles, speeds, torques, powers, ages, temperatures, faults, voltages, restarted)

    def enable(self) -> None:
        """Enable what is not enabled yet; what is, is held without force, so that nothing kicks."""
        self._wanted = Power.ENABLED
        for motor in self._motors:
            if self._is_enabled(motor):
                here = MitCommand(motor.joint.motor(motor.angle))
                self._send(motor, motor.layout.pack_command(here))
            else:
                motor.answered = motor.answered and motor.enabled
                motor.enabled, motor.unknown = True, False
                self._send(motor, wire.ENABLE)

    def write(self, targets: Targets) -> None:
        """Send targets with the gains of the description."""
        most = self._most
        for motor, angle, speed, torque in zip(self._motors, *targets, strict=True):
            nearer = angle if most is None else near(motor.joint, motor.angle, angle, most)
            self._send(
                motor, motor.layout.pack_target(*motor.units.motor(nearer, speed, torque), motor.gains)
            )

    def braking(self) -> str:
        """Return nothing: a motor that is enabled obeys."""
        return ""

    def probe(self, kd: float) -> bool:
        """Ask each motor by a command to give way: one that is off only answers it."""
        self.damp(kd)
        return True

    def lower(self, targets: Targets, kd: float) -> None:  # noqa: ARG002 - damping needs no targets
        """Give way with damping."""
        self.damp(kd)

    def damp(self, kd: float) -> None:
        """No stiffness, only damping: one frame each."""
        self._wanted = Power.STOPPING
        for motor in self._motors:
            self._send(motor, self._giving_way(motor, kd))

    def _giving_way(self, motor: _Motor, kd: float) -> bytes:
        """Return the command that damps a motor; one that is off stays off, and answers."""
        joint = motor.joint
        return motor.layout.pack_command(MitCommand(joint.motor(motor.angle), kd=kd / joint.kind.ratio**2))

    def quick_stop(self) -> None:
        """Damp as the description says."""
        self.damp(self._dog.safety.kd)

    def disable(self) -> None:
        """Take the torque off."""
        self._wanted = Power.DISABLED
        for motor in self._motors:
            motor.enabled = motor.unknown = False
            self._send(motor, wire.DISABLE)

    def reset_fault(self) -> None:
        """Clear errors, where the motor has such a frame."""
        for motor in self._motors:
            self._send(motor, wire.CLEAR if motor.profile.damiao else wire.DISABLE)

    def _power(self, motor: _Motor) -> tuple[Power, str]:
        """Return what a motor is doing, and its fault."""
        joint, status = motor.joint, motor.status
        if motor.told_at == NEVER:
            return Power.ABSENT, ""
        damiao = motor.profile.damiao
        if damiao and status is not None and status in wire.STATUS:
            return Power.FAULT, f"{wire.STATUS[status]} (status {status:X}h)"
        if motor.profile.error_at is not None and status:
            return Power.FAULT, f"error {status} of the motor"
        if motor.answers.doubled:
            return Power.FAULT, f"two motors answer as id {joint.id} on bus {joint.bus}: give each its own"
        if motor.restarted:
            why = f"id {joint.id} let go by itself (status 0h); it is configured again after a reset"
            return Power.FAULT, why
        may_hold = self._is_enabled(motor) or (motor.unknown and not damiao)
        return _TOLD[self._wanted] if may_hold else Power.DISABLED, ""

    def _is_enabled(self, motor: _Motor) -> bool:
        if motor.profile.damiao:
            return motor.status == wire.ENABLED
        return motor.enabled and motor.answered

    def _send(self, motor: _Motor, data: bytes) -> None:
        motor.bus.send(CanFrame(motor.id, data))

    def _register(self, motor: _Motor, register: int) -> bytes | None:
        return self._registers.get((motor.joint.bus, motor.joint.id, register))

    def _read(self, register: int) -> None:
        """Read one register of all Damiao motors."""
        self._ask(
            self._damiao,
            lambda motor: CanFrame(wire.REGISTERS, wire.read_register(motor.id, register)),
            lambda motor: self._register(motor, register) is not None,
        )

    def _ask(
        self, motors: list[_Motor], question: Callable[[_Motor], CanFrame], answered: Callable[[_Motor], bool]
    ) -> None:
        ask_all(motors, self._buses, self.take, question, answered)

    def _check_ranges(self) -> None:
        """Refuse motors whose frames mean other numbers than the profile says."""
        for motor in self._damiao:
            wanted = motor.profile.angle, motor.profile.speed, motor.profile.torque
            for register, name, most in zip(wire.RANGE_REGISTERS, _NAMES, wanted, strict=True):
                (actual,) = struct.unpack("<f", self._register(motor, register) or bytes(4))
                if not math.isclose(actual, most, rel_tol=1e-3):
                    raise LinkRefused(
                        f"{motor.joint.name}: register {register} ({name}) is {actual:g}, "
                        f"wanted {most:g} for {profile_name(self._dog.drive, motor.joint.kind)}"
                    )
