"""ODrives as a ``JointDrive``: polled by remote frames; stiffness and damping through their gains.

An ODrive damps with its position gain at zero. Its commands are not acknowledged: those that may be lost are
repeated in turn, for one joint per cycle, and the state in the heartbeat is decisive.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fleet import CanBus, CanFrame
from fleet_quadruped.body.measured import Targets
from fleet_quadruped.can.bus_guard import BusAddress
from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.damping import DampingGroup
from fleet_quadruped.drives.motor_units import Units, near
from fleet_quadruped.drives.odrive import frames as wire
from fleet_quadruped.drives.odrive.axis import OdriveAxis
from fleet_quadruped.drives.odrive.commission import commission
from fleet_quadruped.drives.odrive.frames import OdriveCommand, State
from fleet_quadruped.robot.busload import frame_bits
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.parts import CanBusConfig, Drive

_STATE_EVERY = 3  # cycles between two polls for the state of one drive
_SLOW = (
    OdriveCommand.TORQUES,
    OdriveCommand.TEMPERATURE,
    OdriveCommand.SUPPLY,
)  # one value of one drive in each cycle
_GEARING = 4  # cycles in which gains are sent to all drives; afterwards to one per cycle
_FED = 4  # control cycles that the drives' watchdog must cover


class OdriveDrives(DampingGroup[OdriveAxis]):
    """All ODrives of a robot; ``buses`` by name."""

    def __init__(self, dog: DogDescription, buses: Mapping[str, CanBus], joints: Sequence[Joint]) -> None:
        super().__init__(dog, buses, [_axis(joint, buses[joint.bus]) for joint in joints])
        self._by_node = {(axis.joint.bus, axis.id): axis for axis in self._drives}
        self._cycle = 0
        self._since = 0  # cycles for which the wanted state has not changed
        self._geared = 0  # cycles in which gains were sent

    @staticmethod
    def problems(dog: DogDescription) -> list[str]:
        """Return impossible node ids, stiffness without damping, and a watchdog that is too short."""
        found = [
            f"joints.{name}: id {wiring.id} is no node of an ODrive; the highest is {wire.HIGHEST_NODE}"
            for name, wiring in dog.joints.items()
            if wiring.id > wire.HIGHEST_NODE
        ]
        found += [
            f"actuators.{part}: kd must not be 0; the stiffness of an ODrive is position gain x velocity gain"
            for part, kind in dog.actuators.items()
            if kind.kd == 0
        ]
        if dog.drive.timeout < _FED / dog.drive.cycle_hz:
            found.append(f"drive.timeout: {dog.drive.timeout:g} s is less than {_FED} control cycles")
        return found

    @staticmethod
    def load(drive: Drive, joints: int, bus: CanBusConfig) -> float:
        """Return the load by polls, answers and targets; gains while damping do not exceed it."""
        requested = frame_bits(0) + frame_bits(8)
        each = requested * (1 + 1 / _STATE_EVERY) + frame_bits(8)
        in_turn = requested + 2 * frame_bits(8) + frame_bits(4)
        return drive.cycle_hz * (joints * each + in_turn) / bus.bitrate

    @staticmethod
    def identifiers(drive: Drive, joint: Joint) -> tuple[int, ...]:  # noqa: ARG004 - independent of the model
        """Return the identifiers of the node's commands."""
        return tuple(wire.identifier(joint.id, command) for command in OdriveCommand)

    @staticmethod
    def farthest(joint: Joint, drive: Drive) -> float:  # noqa: ARG004 - independent of the model
        """Return the angle up to which its numbers are exact."""
        return wire.MOST_TURNS * wire.TURN

    @property
    def addresses(self) -> frozenset[BusAddress]:
        """Identifiers of each node's commands for a position and for a state."""
        orders = (OdriveCommand.INPUT_POS, OdriveCommand.STATE)
        return frozenset(
            (bus, wire.identifier(node, order)) for bus, node in self._by_node for order in orders
        )

    def configure(self) -> None:
        """Check all drives and set their watchdog; see ``commission``."""
        commission(self._drives, self._requester, self._dog.drive)

    def handle_frame(self, bus: str, frame: CanFrame, now: float) -> None:
        """Process a received frame."""
        node, command = wire.split(frame.id)
        axis = self._by_node.get((bus, node))
        if axis is not None:
            axis.handle_data(command, frame.data, now)

    def target(self, bus: str, frame: CanFrame) -> tuple[Joint, float] | None:
        """Return joint and target of a position command."""
        node, command = wire.split(frame.id)
        axis = self._by_node.get((bus, node))
        decoded = wire.unpack_input(frame.data) if command == OdriveCommand.INPUT_POS else None
        return None if axis is None or decoded is None else (axis.joint, axis.joint.angle(decoded[0]))

    def begin_cycle(self, now: float) -> None:  # noqa: ARG002 - not needed here
        """Poll the positions of all drives, the state of some, and one slow value of one drive."""
        self._cycle += 1
        hurry = self._wanted is Power.ENABLED and not all(axis.held for axis in self._drives)
        for number, axis in enumerate(self._drives):
            axis.answers.begin()
            axis.bus.send(wire.request(axis.id, OdriveCommand.ESTIMATES))
            if hurry or (number + self._cycle) % _STATE_EVERY == 0 or axis.state is None:
                axis.bus.send(wire.request(axis.id, OdriveCommand.HEARTBEAT))
        turn, number = divmod(self._cycle, len(self._drives))
        axis = self._drives[number]
        axis.bus.send(wire.request(axis.id, _SLOW[turn % len(_SLOW)]))

    def enable(self) -> None:
        """Request closed loop with zero gains; drives already in it stay there without force."""
        step, self._geared = self._count(Power.ENABLED) % 3, 0
        for axis in self._drives:
            if axis.state == State.CLOSED_LOOP:
                axis.stay()
            elif step == 0:
                axis.send(OdriveCommand.MODES, wire.pack_modes())
                axis.send(OdriveCommand.POS_GAIN, wire.pack_gain(0.0))
            elif step == 1:
                axis.send(OdriveCommand.VEL_GAINS, wire.pack_pair(0.0, 0.0))
                axis.stay()
            else:
                axis.send(OdriveCommand.STATE, wire.pack_state(State.CLOSED_LOOP))

    def write(self, targets: Targets) -> None:
        """Send targets, and gains: to all drives at first, then to one per cycle."""
        self._count(Power.ENABLED)
        for axis, angle, speed, torque in zip(self._drives, *targets, strict=True):
            nearer = near(axis.joint, axis.angle, angle, self._most)
            axis.send(OdriveCommand.INPUT_POS, wire.pack_input(*axis.units.motor(nearer, speed, torque)))
        for axis in self._next_geared():
            axis.send(OdriveCommand.MODES, wire.pack_modes())
            axis.send(OdriveCommand.POS_GAIN, axis.position_gain)
            axis.send(OdriveCommand.VEL_GAINS, axis.velocity_gains)

    def _next_geared(self) -> Sequence[OdriveAxis]:
        """Return the drives whose gains are sent in this cycle: every second one at first, later one."""
        self._geared += 1
        if self._geared <= _GEARING:
            return self._drives[self._geared % 2 :: 2]
        number = self._cycle % len(self._drives)
        return self._drives[number : number + 1]

    def damp(self, kd: float) -> None:
        """No stiffness, damping only. Gains do not feed the watchdog, positions do: both are sent in turn."""
        count, self._geared = self._count(Power.STOPPING), 0
        for axis in self._drives:
            if count % 2 == 0:
                _, velocity = wire.gains(0.0, kd / axis.joint.kind.ratio**2)
                axis.send(OdriveCommand.POS_GAIN, wire.pack_gain(0.0))
                axis.send(OdriveCommand.VEL_GAINS, wire.pack_pair(velocity, 0.0))
            if count % 2 == 1 or count == 0:
                axis.stay()

    def disable(self) -> None:
        """Take the torque off."""
        self._count(Power.DISABLED)
        for axis in self._drives:
            axis.send(OdriveCommand.STATE, wire.pack_state(State.IDLE))

    def reset_fault(self) -> None:
        """Clear errors."""
        for axis in self._drives:
            axis.send(OdriveCommand.CLEAR, bytes(1))

    def _count(self, wanted: Power) -> int:
        """Set the wanted state of the drives; return the number of cycles for which it was wanted before."""
        self._since = self._since + 1 if wanted is self._wanted else 0
        self._want(wanted)
        return self._since


def _axis(joint: Joint, bus: CanBus) -> OdriveAxis:
    """Return the drive of a joint, without feedback yet."""
    kind = joint.kind
    position, velocity = wire.gains(kind.kp / kind.ratio**2, kind.kd / kind.ratio**2)
    gains = wire.pack_gain(position), wire.pack_pair(velocity, 0.0)
    return OdriveAxis(joint, bus, joint.id, Units(joint), *gains)
