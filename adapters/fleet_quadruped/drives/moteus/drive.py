"""moteus servos as a ``JointDrive``: a servo only answers frames.

Each command has its own watchdog; a servo that receives nothing damps by itself and stays so until it is
stopped. In position mode its damping is limited to the share of its stiffness, so a servo without stiffness
does not damp at all: damping uses the mode *zero velocity*.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fleet import CanBus, CanFrame
from fleet_quadruped.body.measured import Targets
from fleet_quadruped.can.bus_guard import BusAddress
from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.damping import DampingGroup
from fleet_quadruped.drives.moteus import frames as wire
from fleet_quadruped.drives.moteus.commission import Diagnostics, commission
from fleet_quadruped.drives.moteus.frames import ServoCommand
from fleet_quadruped.drives.moteus.servo import MoteusServo
from fleet_quadruped.drives.motor_units import Units
from fleet_quadruped.robot.busload import fd_frame_seconds
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.parts import CanBusConfig, Drive

_COMMAND_BYTES, _REPLY_BYTES = 48, 32


class MoteusDrives(DampingGroup[MoteusServo]):
    """All moteus servos of a robot; ``buses`` by name."""

    def __init__(self, dog: DogDescription, buses: Mapping[str, CanBus], joints: Sequence[Joint]) -> None:
        super().__init__(dog, buses, [_servo(joint, buses[joint.bus], dog.drive.timeout) for joint in joints])
        self._by_reply = {(one.joint.bus, wire.from_servo(one.id)): one for one in self._drives}
        self._by_command = {(one.joint.bus, wire.to_servo(one.id)): one for one in self._drives}
        self._diagnostics = Diagnostics(self._drives, self._requester)

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
    def load(drive: Drive, joints: int, bus: CanBusConfig) -> float:
        """Return the load by a command and a reply per joint and cycle."""
        both = fd_frame_seconds(_COMMAND_BYTES, bus) + fd_frame_seconds(_REPLY_BYTES, bus)
        return drive.cycle_hz * joints * both

    @staticmethod
    def identifiers(drive: Drive, joint: Joint) -> tuple[int, ...]:  # noqa: ARG004 - independent of the model
        """Return its reply identifier, and all that it accepts: it would execute another node's frames."""
        return (*wire.heard_by(joint.id), wire.from_servo(joint.id))

    @staticmethod
    def farthest(joint: Joint, drive: Drive) -> float:  # noqa: ARG004 - independent of the model
        """Return the angle up to which its numbers are exact."""
        return wire.MOST_TURNS * wire.TURN

    @property
    def addresses(self) -> frozenset[BusAddress]:
        """Identifiers of the frames to each servo."""
        return frozenset(self._by_command)

    def configure(self) -> None:
        """Check and configure all servos; see ``commission``."""
        commission(self._drives, self._requester, self._diagnostics, self._dog.safety.kd)

    def handle_frame(self, bus: str, frame: CanFrame, now: float) -> None:
        """Process a received frame."""
        servo = self._by_reply.get((bus, frame.id))
        parts = None if servo is None else wire.unpack(frame.data)
        if servo is None or parts is None:
            return
        text = b"".join(part.text for part in parts if part.kind == 0x41)
        if text:
            self._diagnostics.handle_text(servo, text)
        registers = wire.reply(parts)
        if registers is not None:
            servo.handle_registers(registers, frame.data, now)

    def target(self, bus: str, frame: CanFrame) -> tuple[Joint, float] | None:
        """Return joint and target of a command; None for one without stiffness."""
        servo = self._by_command.get((bus, frame.id))
        for part in (servo and wire.unpack(frame.data)) or ():
            if servo and part.kind == 0 and part.start == wire.COMMAND and part.values[3] > 0:
                return servo.joint, servo.joint.angle(part.values[0] * wire.TURN)
        return None

    def enable(self) -> None:
        """Request position mode at each servo's position, without force."""
        self._want(Power.ENABLED)
        for servo in self._drives:
            servo.hold_limp(servo.torque_limit(self._most))

    def write(self, targets: Targets) -> None:
        """Send targets with the gains of the description and the torque limit."""
        self._want(Power.ENABLED)
        for servo, angle, speed, torque in zip(self._drives, *targets, strict=True):
            place, turning, pushed = servo.units.motor(angle, speed, torque)
            demand = ServoCommand(
                place / wire.TURN,
                turning / wire.TURN,
                pushed,
                servo.kp_scale,
                servo.kd_scale,
                servo.torque_limit(self._most),
                servo.watchdog,
            )
            servo.send(wire.pack_demand(wire.OBEYS, demand))

    def damp(self, kd: float) -> None:
        """Zero velocity: no stiffness, damping only. A servo without torque is only polled."""
        self._want(Power.STOPPING)
        for servo in self._drives:
            servo.damp(kd)

    def disable(self) -> None:
        """Stop: no torque. A servo with a fault has none and is only polled: a stop would clear its fault."""
        self._want(Power.DISABLED)
        for servo in self._drives:
            servo.disable()

    def reset_fault(self) -> None:
        """Clear faults."""
        for servo in self._drives:
            servo.send(wire.pack_mode(wire.STOPPED))


def _servo(joint: Joint, bus: CanBus, watchdog: float) -> MoteusServo:
    """Return the servo of a joint, without feedback yet."""
    kind, square = joint.kind, joint.kind.ratio**2
    kp, kd = kind.kp / square * wire.TURN, kind.kd / square * wire.TURN
    return MoteusServo(joint, bus, joint.id, Units(joint), kp, kd, watchdog)
