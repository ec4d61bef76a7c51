"""Twelve CiA 402 drives as a ``JointDrive``: our own cyclic loop, walker, watchdogs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter

from fleet import CanBus, CanFrame
from fleet_quadruped.body.measured import Targets
from fleet_quadruped.can.bus_guard import Address
from fleet_quadruped.drives.answers import Answers
from fleet_quadruped.drives.base import NEVER, Joints, Power
from fleet_quadruped.drives.cia402.commission import commission, limit_drive
from fleet_quadruped.drives.cia402.frames import (
    BOOT_UP,
    EMERGENCY,
    HEARTBEAT,
    MASTER,
    MOST_COUNTS,
    NMT,
    NMT_START,
    OPERATIONAL,
    OUR_SILENCE,
    RPDO1,
    SDO_REQUEST,
    SDO_RESPONSE,
    SHORT,
    SYNC,
    TPDO1,
    TPDO2,
    Rpdos,
    Units,
    meaning,
    unpack_emergency,
    unpack_slow,
)
from fleet_quadruped.drives.cia402.setup import TORQUE_OFFSET
from fleet_quadruped.drives.cia402.states import (
    FOLLOWS,
    POWER,
    DriveGoal,
    DriveState,
    control_words,
    state_of,
)
from fleet_quadruped.robot.busload import SLOW_EVERY, frame_bits
from fleet_quadruped.robot.description import DogDescription, Joint
from fleet_quadruped.robot.names import Twelve
from fleet_quadruped.robot.parts import Bus, Drive

_OF_ONE = (EMERGENCY, TPDO1, RPDO1, TPDO2, SDO_RESPONSE, SDO_REQUEST, HEARTBEAT)
_SILENT = 8  # heartbeats that may be missing on a lossy bus; TPDOs tell silence sooner


@dataclass(slots=True)
class _Node:
    """One drive as it was last heard; times are monotonic seconds."""

    joint: Joint
    units: Units
    status: int = 0  # 6041h
    state: DriveState = DriveState.NOT_READY
    follows: bool = True
    angle: float = 0.0
    speed: float = 0.0
    torque: float = 0.0
    temperature: float | None = None
    voltage: float | None = None
    told_at: float = NEVER
    beat_at: float = math.inf
    answers: Answers = field(default_factory=Answers)
    fault: str = ""
    feeds: bool = True  # it takes a torque besides the target
    restarted: bool = False  # it is not trusted until it is configured again
    nmt: int = OPERATIONAL  # as its heartbeat says
    stopped_alone: bool = False  # it missed our heartbeat, and may go on by the next control word


_VALUES = attrgetter("angle", "speed", "torque", "told_at", "temperature", "voltage", "restarted")


class Cia402Drives:
    """All drives of a dog, on the buses by their names."""

    def __init__(self, dog: DogDescription, buses: Mapping[str, CanBus], joints: Sequence[Joint]) -> None:
        self._dog = dog
        self._buses = buses
        self._nodes = [_Node(joint, Units(joint)) for joint in joints]
        self._places = [(buses[joint.bus], RPDO1 + joint.id) for joint in joints]
        self._rpdos = Rpdos(joints)
        self._nothing = (0.0,) * len(joints)
        self._silence = _SILENT * dog.drive.heartbeat
        self._half = dog.dt / 2
        self._full: dict[str, int] = {}  # joints to the torque limits they had
        self._by_frame = {
            (node.joint.bus, base + node.joint.id): (handler, node)
            for node in self._nodes
            for base, handler in (
                (TPDO1, self._told),
                (TPDO2, self._slow),
                (EMERGENCY, self._emergency),
                (HEARTBEAT, self._beat),
            )
        }

    @staticmethod
    def problems(dog: DogDescription) -> list[str]:  # noqa: ARG004 - each of its keys is checked by itself
        """Return that nothing is wrong."""
        return []

    @staticmethod
    def load(drive: Drive, joints: int, bus: Bus) -> float:
        """Return what PDOs, SYNC and heartbeats take."""
        cyclic = joints * (2 + 1 / SLOW_EVERY) * frame_bits(8) + frame_bits(0) + frame_bits(1)
        return (drive.cycle_hz * cyclic + joints * frame_bits(1) / drive.heartbeat) / bus.bitrate

    @staticmethod
    def shared(dog: DogDescription) -> tuple[int, ...]:  # noqa: ARG004 - the same for each make
        """Return NMT, SYNC and our own heartbeat."""
        return 0, SYNC, HEARTBEAT + MASTER

    @staticmethod
    def identifiers(drive: Drive, joint: Joint) -> tuple[int, ...]:  # noqa: ARG004 - the same for each make
        """Return emergencies, PDOs, SDOs and heartbeat."""
        return tuple(base + joint.id for base in _OF_ONE)

    @staticmethod
    def farthest(joint: Joint, drive: Drive) -> float:  # noqa: ARG004 - it hangs on the joint alone
        """Return the angle of the greatest count."""
        return MOST_COUNTS / joint.kind.counts_per_rad

    @property
    def addresses(self) -> frozenset[Address]:
        """Each RPDO1."""
        return frozenset((node.joint.bus, RPDO1 + node.joint.id) for node in self._nodes)

    def configure(self) -> None:
        """Configure and start all drives; see ``commission``."""
        missing: dict[str, frozenset[int]] = {}
        for name, bus in self._buses.items():
            joints = [node.joint for node in self._nodes if node.joint.bus == name]
            if joints:
                missing |= commission(bus, joints, self._dog.drive)
        for node in self._nodes:
            node.told_at, node.beat_at = NEVER, math.inf
            node.fault, node.restarted, node.nmt = "", False, OPERATIONAL
            node.feeds = TORQUE_OFFSET not in missing.get(node.joint.name, ())

    def limit_torque(self, torque: float | None) -> None:
        """Write 6072h of each drive; its own limit is kept, and written again at the end."""
        for node in self._nodes:
            joint = node.joint
            before = self._full.get(joint.name)
            if torque is None and before is None:
                continue
            limit = before if torque is None else node.units.per_mille(joint.sign * torque)
            found = limit_drive(self._buses[joint.bus], joint, limit or 0)
            self._full.setdefault(joint.name, found)

    def take(self, bus: str, frame: CanFrame, now: float) -> None:
        """Take a received frame."""
        found = self._by_frame.get((bus, frame.id))
        if found is not None:
            found[0](found[1], frame.data, now)

    def target(self, bus: str, frame: CanFrame) -> tuple[Joint, float] | None:
        """Return which joint an RPDO1 sends where."""
        found = self._by_frame.get((bus, frame.id - RPDO1 + TPDO1))
        if found is None or not RPDO1 < frame.id <= RPDO1 + MASTER:
            return None
        told = found[1].units.unpack(frame.data)
        return None if told is None else (found[1].joint, told[1])

    def begin_cycle(self, now: float) -> None:  # noqa: ARG002 - every cycle is alike
        """Send our heartbeat and SYNC; one each cycle, so that a few lost ones do not stop the drives.

        A drive that left operation, but was not restarted, is started again: it is configured still.
        """
        for node in self._nodes:
            node.answers.begin()
            if node.nmt != OPERATIONAL and not node.restarted:
                self._buses[node.joint.bus].send(CanFrame(NMT, bytes([NMT_START, node.joint.id])))
        self._send_all(CanFrame(HEARTBEAT + MASTER, bytes([OPERATIONAL])))
        self._send_all(CanFrame(SYNC, b""))

    def complete(self) -> bool:
        """Return True when each drive has sent its TPDO since SYNC."""
        return all(node.answers.complete for node in self._nodes)

    def feedback(self, now: float) -> Joints:
        """Return what is known of the joints."""
        angles, speeds, torques, told, temperatures, voltages, restarted = zip(
            *map(_VALUES, self._nodes), strict=True
        )
        powers, faults = zip(*[self._power(node, now) for node in self._nodes], strict=True)
        ages = tuple([now - at for at in told])
        return Joints(angles, speeds, torques, powers, ages, temperatures, faults, voltages, restarted)

    def enable(self) -> None:
        """Walk one step towards operation enabled, with the measured place as the target."""
        self._stay(DriveGoal.ENABLE)

    def write(self, targets: Targets) -> None:
        """Send targets to the drives that are enabled."""
        self._send(DriveGoal.HOLD, targets.angles, targets.torques)

    def braking(self) -> str:
        """Return the joint of a drive that is in quick stop."""
        return next((node.joint.name for node in self._nodes if node.state is DriveState.QUICK_STOP), "")

    def probe(self, kd: float) -> bool:  # noqa: ARG002 - nothing is written
        """Do nothing: drives tell where they are at each SYNC."""
        return False

    def lower(self, targets: Targets, kd: float) -> None:  # noqa: ARG002 - positions cannot damp
        """Go to the targets, also from a quick stop: with 605Ah = 6 it holds, and damps nothing."""
        self._send(DriveGoal.LOWER, targets.angles, targets.torques)

    def damp(self, kd: float) -> None:  # noqa: ARG002 - positions cannot damp
        """Quick stop: with 605Ah = 6 the drives brake and hold."""
        self.quick_stop()

    def quick_stop(self) -> None:
        """Brake all joints and hold them."""
        self._stay(DriveGoal.STOP)

    def disable(self) -> None:
        """Take the torque off."""
        self._stay(DriveGoal.OFF)

    def reset_fault(self) -> None:
        """Acknowledge faults: a rising edge, because all other control words have the bit at zero."""
        for node in self._nodes:
            node.fault = ""
        self._stay(DriveGoal.RESET)

    def _send_all(self, frame: CanFrame) -> None:
        for bus in self._buses.values():
            bus.send(frame)

    def _stay(self, goal: DriveGoal) -> None:
        """Send a goal, with the measured place as the target."""
        self._send(goal, tuple(node.angle for node in self._nodes), self._nothing)

    def _send(self, goal: DriveGoal, angles: Twelve, torques: Twelve) -> None:
        words = control_words(goal, [node.state for node in self._nodes])
        frames = self._rpdos.pack(words, angles, torques)
        for node, (bus, identifier), data in zip(self._nodes, self._places, frames, strict=True):
            bus.send(CanFrame(identifier, data if node.feeds else data[:SHORT]))

    def _power(self, node: _Node, now: float) -> tuple[Power, str]:
        """Return what a drive is doing, and its fault."""
        if node.told_at == NEVER:
            return Power.ABSENT, ""
        if node.restarted or node.answers.doubled or now - node.beat_at > self._silence:
            distrust = self._distrust(node, now)
            return Power.FAULT, (node.restarted and distrust) or node.fault or distrust
        if node.state is DriveState.ENABLED and node.stopped_alone:
            return Power.STOPPING, node.fault
        if node.state is DriveState.ENABLED and node.nmt != OPERATIONAL:
            return Power.STOPPING, f"id {node.joint.id} has left operation (heartbeat {node.nmt:02X}h)"
        if not node.follows:
            return Power.STARTING, "it is enabled and ignores its target (bit 12 of 6041h is 0)"
        return POWER[node.state], node.fault

    def _distrust(self, node: _Node, now: float) -> str:
        """Return why a drive is not to be trusted whatever its status word says."""
        number = node.joint.id
        if node.restarted:
            return f"id {number} has restarted (boot-up, 700h); it is configured again after a reset"
        if node.answers.doubled:
            return f"two drives answer as id {number} on bus {node.joint.bus}: give each its own"
        return f"no heartbeat (700h) from id {number} for {now - node.beat_at:.2f} s"

    def _told(self, node: _Node, data: bytes, now: float) -> None:
        """Take a TPDO1: status, angle, torque; the speed is what the angle has changed by."""
        told = node.units.unpack(data)
        if told is None:
            return
        status, angle, node.torque = told
        passed = now - node.told_at
        if passed > self._half:  # a late answer and the next come together, and were measured a cycle apart
            node.speed = (angle - node.angle) / passed
        node.angle, node.told_at = angle, now
        if status != node.status:
            node.status, node.state = status, state_of(status)
            node.stopped_alone = node.stopped_alone and node.state is DriveState.ENABLED
            node.follows = node.state is not DriveState.ENABLED or status & FOLLOWS != 0
        node.answers.take(data)

    def _slow(self, node: _Node, data: bytes, _now: float) -> None:
        slow = unpack_slow(data)
        if slow is None:
            return
        node.voltage = slow.voltage
        if slow.temperature is not None and self._dog.drive.temperature is not None:
            node.temperature = slow.temperature * self._dog.drive.temperature.scale
        if slow.code and node.state in {DriveState.FAULT, DriveState.FAULT_REACTION}:
            node.fault = node.fault or f"{meaning(slow.code)} (603Fh is {slow.code:04X}h)"

    def _emergency(self, node: _Node, data: bytes, _now: float) -> None:
        told = unpack_emergency(data)
        if told is not None:
            node.fault = "" if told.cleared else told.text
            node.stopped_alone = told.code == OUR_SILENCE

    def _beat(self, node: _Node, data: bytes, now: float) -> None:
        state = data[0] & 0x7F if data else None
        if state == BOOT_UP and node.beat_at < math.inf:
            node.restarted = True
        if state is not None and state != BOOT_UP:
            node.nmt = state
        node.beat_at = now
