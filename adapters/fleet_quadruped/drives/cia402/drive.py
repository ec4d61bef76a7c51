"""CiA 402 drives as a ``JointDrive``: own cyclic exchange, state transitions and watchdogs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from fleet import CanBus, CanFrame
from fleet_quadruped.body.measured import Targets
from fleet_quadruped.can.bus_guard import BusAddress
from fleet_quadruped.drives.cia402.commission import commission, limit_drive
from fleet_quadruped.drives.cia402.frames import (
    EMERGENCY,
    HEARTBEAT,
    MASTER,
    MOST_COUNTS,
    NMT,
    NMT_START,
    OPERATIONAL,
    RPDO1,
    SDO_REQUEST,
    SDO_RESPONSE,
    SHORT,
    SYNC,
    TPDO1,
    TPDO2,
    CountUnits,
    Rpdos,
)
from fleet_quadruped.drives.cia402.node import Cia402Node
from fleet_quadruped.drives.cia402.setup import TORQUE_OFFSET
from fleet_quadruped.drives.cia402.states import DriveGoal, DriveState, control_words
from fleet_quadruped.drives.group import DriveGroup
from fleet_quadruped.robot.busload import SLOW_EVERY, frame_bits
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.names import Twelve
from fleet_quadruped.robot.parts import CanBusConfig, Drive

_OF_ONE = (EMERGENCY, TPDO1, RPDO1, TPDO2, SDO_RESPONSE, SDO_REQUEST, HEARTBEAT)
_SILENT = 8  # heartbeats that may be lost on a bad bus; missing TPDOs show silence sooner
_HANDLERS: tuple[tuple[int, Callable[[Cia402Node, bytes, float], None]], ...] = (
    (TPDO1, Cia402Node.handle_status),
    (TPDO2, Cia402Node.handle_slow),
    (EMERGENCY, Cia402Node.handle_emergency),
    (HEARTBEAT, Cia402Node.handle_heartbeat),
)


class Cia402Drives(DriveGroup[Cia402Node]):
    """All CiA 402 drives of a robot; ``buses`` by name."""

    def __init__(self, dog: DogDescription, buses: Mapping[str, CanBus], joints: Sequence[Joint]) -> None:
        super().__init__(dog, buses, [_node(joint, dog) for joint in joints])
        self._sender = RpdoSender(self._drives, buses)
        self._full: dict[str, int] = {}  # joints to the torque limits they had
        self._by_frame = {
            (node.joint.bus, base + node.joint.id): (handle, node)
            for node in self._drives
            for base, handle in _HANDLERS
        }

    @staticmethod
    def load(drive: Drive, joints: int, bus: CanBusConfig) -> float:
        """Return the load by PDOs, SYNC and heartbeats."""
        cyclic = joints * (2 + 1 / SLOW_EVERY) * frame_bits(8) + frame_bits(0) + frame_bits(1)
        return (drive.cycle_hz * cyclic + joints * frame_bits(1) / drive.heartbeat) / bus.bitrate

    @staticmethod
    def shared(dog: DogDescription) -> tuple[int, ...]:  # noqa: ARG004 - independent of the model
        """Return NMT, SYNC and our own heartbeat."""
        return 0, SYNC, HEARTBEAT + MASTER

    @staticmethod
    def identifiers(drive: Drive, joint: Joint) -> tuple[int, ...]:  # noqa: ARG004 - independent of the model
        """Return emergency, PDOs, SDOs and heartbeat."""
        return tuple(base + joint.id for base in _OF_ONE)

    @staticmethod
    def farthest(joint: Joint, drive: Drive) -> float:  # noqa: ARG004 - depends on the joint alone
        """Return the angle of the largest count."""
        return MOST_COUNTS / joint.kind.counts_per_rad

    @property
    def addresses(self) -> frozenset[BusAddress]:
        """RPDO1 of each node."""
        return frozenset((node.joint.bus, RPDO1 + node.joint.id) for node in self._drives)

    def configure(self) -> None:
        """Configure and start all drives; see ``commission``."""
        missing: dict[str, frozenset[int]] = {}
        for name, bus in self._buses.items():
            joints = [node.joint for node in self._drives if node.joint.bus == name]
            if joints:
                missing |= commission(bus, joints, self._dog.drive)
        for node in self._drives:
            node.configured(feeds=TORQUE_OFFSET not in missing.get(node.joint.name, ()))

    def limit_torque(self, torque: float | None) -> None:
        """Write 6072h of each drive; the previous limit is kept and restored at the end."""
        for node in self._drives:
            joint = node.joint
            before = self._full.get(joint.name)
            if torque is None and before is None:
                continue
            limit = before if torque is None else node.units.per_mille(joint.sign * torque)
            found = limit_drive(self._buses[joint.bus], joint, limit or 0)
            self._full.setdefault(joint.name, found)

    def handle_frame(self, bus: str, frame: CanFrame, now: float) -> None:
        """Process a received frame."""
        found = self._by_frame.get((bus, frame.id))
        if found is not None:
            handle, node = found
            handle(node, frame.data, now)

    def target(self, bus: str, frame: CanFrame) -> tuple[Joint, float] | None:
        """Return joint and target of an RPDO1."""
        found = self._by_frame.get((bus, frame.id - RPDO1 + TPDO1))
        if found is None or not RPDO1 < frame.id <= RPDO1 + MASTER:
            return None
        decoded = found[1].units.unpack(frame.data)
        return None if decoded is None else (found[1].joint, decoded[1])

    def begin_cycle(self, now: float) -> None:
        """Send our heartbeat and SYNC; once per cycle, so that a few lost ones do not stop the drives.

        A node that left operational without a restart is started again: its configuration is still valid.
        """
        super().begin_cycle(now)
        for node in self._drives:
            if node.nmt != OPERATIONAL and not node.restarted:
                self._buses[node.joint.bus].send(CanFrame(NMT, bytes([NMT_START, node.joint.id])))
        for frame in (CanFrame(HEARTBEAT + MASTER, bytes([OPERATIONAL])), CanFrame(SYNC, b"")):
            for bus in self._buses.values():
                bus.send(frame)

    def enable(self) -> None:
        """Walk one step towards operation enabled, with the measured place as the target."""
        self._sender.stay(DriveGoal.ENABLE)

    def write(self, targets: Targets) -> None:
        """Send targets to the drives that are enabled."""
        self._sender.send(DriveGoal.HOLD, targets.angles, targets.torques)

    def braking(self) -> str:
        """Return the joint of a drive that is in quick stop."""
        return next((node.joint.name for node in self._drives if node.state is DriveState.QUICK_STOP), "")

    def probe(self, kd: float) -> bool:  # noqa: ARG002 - nothing is sent
        """Do nothing: the drives report at each SYNC."""
        return False

    def lower(self, targets: Targets, kd: float) -> None:  # noqa: ARG002 - position mode cannot damp
        """Follow the targets, also out of a quick stop: with 605Ah = 6 the drive holds, and cannot damp."""
        self._sender.send(DriveGoal.LOWER, targets.angles, targets.torques)

    def damp(self, kd: float) -> None:  # noqa: ARG002 - position mode cannot damp
        """Quick stop: with 605Ah = 6 the drives brake and hold."""
        self.quick_stop()

    def quick_stop(self) -> None:
        """Brake all joints and hold them."""
        self._sender.stay(DriveGoal.STOP)

    def disable(self) -> None:
        """Take the torque off."""
        self._sender.stay(DriveGoal.OFF)

    def reset_fault(self) -> None:
        """Acknowledge faults: bit 7 rises, because it is zero in all other control words."""
        for node in self._drives:
            node.fault = ""
        self._sender.stay(DriveGoal.RESET)


class RpdoSender:
    """Sends RPDO1 to all nodes: the control word of the next step, with targets."""

    def __init__(self, nodes: Sequence[Cia402Node], buses: Mapping[str, CanBus]) -> None:
        self._nodes = nodes
        self._places = [(buses[node.joint.bus], RPDO1 + node.joint.id) for node in nodes]
        self._rpdos = Rpdos([node.joint for node in nodes])
        self._nothing = (0.0,) * len(nodes)

    def stay(self, goal: DriveGoal) -> None:
        """Send a goal, with the measured position as the target."""
        self.send(goal, tuple(node.angle for node in self._nodes), self._nothing)

    def send(self, goal: DriveGoal, angles: Twelve, torques: Twelve) -> None:
        """Send a goal and targets: rad and N m of the joints."""
        words = control_words(goal, [node.state for node in self._nodes])
        frames = self._rpdos.pack(words, angles, torques)
        for node, (bus, identifier), data in zip(self._nodes, self._places, frames, strict=True):
            bus.send(CanFrame(identifier, data if node.feeds else data[:SHORT]))


def _node(joint: Joint, dog: DogDescription) -> Cia402Node:
    """Return the drive of a joint, without feedback yet."""
    temperature = dog.drive.temperature
    scale = None if temperature is None else temperature.scale
    return Cia402Node(joint, CountUnits(joint), dog.dt / 2, _SILENT * dog.drive.heartbeat, scale)
