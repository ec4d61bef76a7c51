"""MIT motors as a ``JointDrive``: a motor only answers commands."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence

from fleet import CanBus, CanFrame
from fleet_quadruped.body.measured import Targets
from fleet_quadruped.can.bus_guard import BusAddress
from fleet_quadruped.drives.base import NEVER, Power
from fleet_quadruped.drives.damping import DampingGroup
from fleet_quadruped.drives.mit import frames as wire
from fleet_quadruped.drives.mit.motor import MitMotor
from fleet_quadruped.drives.mit.profiles import PROFILES, MotorProfile, profile_name, profile_of
from fleet_quadruped.drives.mit.registers import DamiaoRegisters
from fleet_quadruped.drives.motor_units import Units, near
from fleet_quadruped.robot.busload import frame_bits
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.parts import CanBusConfig, Drive

log = logging.getLogger(__name__)


class MitDrives(DampingGroup[MitMotor]):
    """All MIT motors of a robot; ``buses`` by name."""

    def __init__(self, dog: DogDescription, buses: Mapping[str, CanBus], joints: Sequence[Joint]) -> None:
        super().__init__(dog, buses, _motors(dog, buses, joints))
        damiao = [motor for motor in self._drives if motor.profile.damiao]
        self._plain = [motor for motor in self._drives if not motor.profile.damiao]
        self._by_id = {(motor.joint.bus, motor.id): motor for motor in self._drives}
        self._by_reply = {(motor.joint.bus, wire.MASTER + motor.id): motor for motor in damiao}
        self._by_number = {(motor.joint.bus, motor.id): motor for motor in self._plain}
        self._registers = DamiaoRegisters(damiao, self._requester)

    @staticmethod
    def problems(dog: DogDescription) -> list[str]:
        """Return unknown motors, and described ones that are built in."""
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
    def load(drive: Drive, joints: int, bus: CanBusConfig) -> float:
        """Return the load by a command and a reply per joint and cycle."""
        return drive.cycle_hz * joints * 2 * frame_bits(8) / bus.bitrate

    @staticmethod
    def shared(dog: DogDescription) -> tuple[int, ...]:
        """Return the identifier of Damiao's registers, and the reply identifier of other motors."""
        kinds = {profile_of(dog.drive, kind).damiao for kind in dog.actuators.values()}
        return tuple(wire.REGISTERS if damiao else 0 for damiao in sorted(kinds))

    @staticmethod
    def identifiers(drive: Drive, joint: Joint) -> tuple[int, ...]:
        """Return the command identifier of a motor, and the reply identifier of a Damiao motor."""
        damiao = profile_of(drive, joint.kind).damiao
        return (joint.id, wire.MASTER + joint.id) if damiao else (joint.id,)

    @staticmethod
    def farthest(joint: Joint, drive: Drive) -> float:
        """Return the range in the profile."""
        return profile_of(drive, joint.kind).angle

    @property
    def addresses(self) -> frozenset[BusAddress]:
        """Command identifier of each motor."""
        return frozenset(self._by_id)

    def configure(self) -> None:
        """Check that all motors answer; check the ranges of Damiao motors and set their watchdog."""
        for motor in self._drives:
            motor.restarted = False
        if self._plain:
            names = sorted({profile_name(self._dog.drive, motor.joint.kind) for motor in self._plain})
            log.warning(
                "%s: no watchdog that can be set over CAN; check it in the maker's tool", ", ".join(names)
            )
            kd = self._dog.safety.kd
            self._requester.request(
                self._plain, lambda motor: motor.damping(kd), lambda motor: motor.reported_at > NEVER
            )
        self._registers.commission(self._dog.drive)

    def handle_frame(self, bus: str, frame: CanFrame, now: float) -> None:
        """Process a received frame."""
        data = frame.data
        motor = self._by_reply.get((bus, frame.id))
        if motor is not None and self._registers.handle_answer(motor, data):
            return
        if motor is None and frame.id == 0 and data:
            motor = self._by_number.get((bus, data[0]))
        if motor is not None:
            motor.handle_reply(data, now)

    def target(self, bus: str, frame: CanFrame) -> tuple[Joint, float] | None:
        """Return joint and target of a command; None for one without stiffness."""
        motor = self._by_id.get((bus, frame.id))
        command = None if motor is None else motor.layout.unpack_command(frame.data)
        if motor is None or command is None or frame.data in wire.SPECIAL:
            return None
        angle, _, kp, *_ = command
        return (motor.joint, motor.joint.angle(angle)) if kp else None

    def enable(self) -> None:
        """Enable the motors that are not enabled yet; the others are held without force."""
        self._want(Power.ENABLED)
        for motor in self._drives:
            motor.enable()

    def write(self, targets: Targets) -> None:
        """Send targets with the gains of the description, moved closer to respect the torque limit."""
        most = self._most
        for motor, angle, speed, torque in zip(self._drives, *targets, strict=True):
            nearer = angle if most is None else near(motor.joint, motor.angle, angle, most)
            motor.send(motor.layout.pack_target(*motor.units.motor(nearer, speed, torque), motor.gains))

    def damp(self, kd: float) -> None:
        """No stiffness, damping only: one frame each."""
        self._want(Power.STOPPING)
        for motor in self._drives:
            motor.bus.send(motor.damping(kd))

    def disable(self) -> None:
        """Take the torque off."""
        self._want(Power.DISABLED)
        for motor in self._drives:
            motor.disable()

    def reset_fault(self) -> None:
        """Clear errors, with the frame of motors that have one."""
        for motor in self._drives:
            motor.send(wire.CLEAR if motor.profile.damiao else wire.DISABLE)


def _motors(dog: DogDescription, buses: Mapping[str, CanBus], joints: Sequence[Joint]) -> list[MitMotor]:
    """Return the motors of joints; motors of one profile share a layout."""
    layouts: dict[MotorProfile, wire.MitLayout] = {}
    motors = []
    for joint in joints:
        kind = joint.kind
        profile = profile_of(dog.drive, kind)
        layout = layouts.setdefault(profile, wire.MitLayout(profile))
        gains = layout.pack_gains(kind.kp / kind.ratio**2, kind.kd / kind.ratio**2)
        motors.append(MitMotor(joint, buses[joint.bus], joint.id, Units(joint), profile, layout, gains))
    return motors
