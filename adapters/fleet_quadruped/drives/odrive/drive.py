"""Twelve ODrives as a ``JointDrive``: asked by remote frames, stiffness and damping by their gains.

An ODrive damps with its position gain at zero. Its commands have no answer: what may have been lost is sent
again in turn, a joint in each cycle, and what counts is the state that the heartbeat tells.
"""

from __future__ import annotations

import logging
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
from fleet_quadruped.drives.motor_units import Units, near
from fleet_quadruped.drives.odrive import frames as wire
from fleet_quadruped.drives.odrive.frames import Cmd, State
from fleet_quadruped.robot.busload import frame_bits
from fleet_quadruped.robot.description import DogDescription, Joint
from fleet_quadruped.robot.parts import Bus, Drive

log = logging.getLogger(__name__)

_STATE_EVERY = 3  # cycles between two questions for the state of one drive
_STATE_AGE = 0.35  # s after which a drive whose heartbeat does not come is not trusted
_SLOW = (Cmd.TORQUES, Cmd.TEMPERATURE, Cmd.SUPPLY)  # one of one drive in each cycle
_GEARING = 4  # cycles in which gains go to all drives; later to one in each cycle
_FED = 4  # cycles that the drives' watchdog must be longer than
_ON = struct.pack("<?", True)
_CALLED = {Power.ENABLED: Power.ENABLED, Power.STOPPING: Power.STOPPING, Power.DISABLED: Power.STOPPING}
"""What a drive in closed loop is called, by what is wanted of it."""


@dataclass(slots=True)
class _Axis:
    """One drive as it was last heard; times are monotonic seconds."""

    joint: Joint
    bus: CanBus
    id: int
    units: Units
    position_gain: bytes
    velocity_gains: bytes
    angle: float = 0.0
    speed: float = 0.0
    torque: float = 0.0
    told_at: float = NEVER
    state: int | None = None
    state_at: float = NEVER
    errors: int = 0
    temperature: float | None = None
    voltage: float | None = None
    version: tuple[int, int] | None = None
    serials: set[bytes] = field(default_factory=set)
    parameters: dict[int, bytes] = field(default_factory=dict)
    answers: Answers = field(default_factory=Answers)
    held: bool = False  # it said that it is in closed loop, since we wanted it
    restarted: bool = False  # it let go by itself, so what was set is not trusted any more


_VALUES = attrgetter("angle", "speed", "torque", "told_at", "temperature", "voltage", "restarted")


class OdriveDrives:
    """All drives of a dog, on the buses by their names."""

    def __init__(self, dog: DogDescription, buses: Mapping[str, CanBus], joints: Sequence[Joint]) -> None:
        self._dog = dog
        self._buses = buses
        self._axes = [self._axis(joint) for joint in joints]
        self._by_node = {(axis.joint.bus, axis.id): axis for axis in self._axes}
        self._cycle = 0
        self._wanted = Power.DISABLED
        self._since = 0  # cycles since that was wanted
        self._geared = 0  # cycles in which gains were sent
        self._most: float | None = None  # N m
        self._takes: Mapping[int, Callable[[_Axis, bytes, float], None]] = {
            Cmd.ESTIMATES: self._estimates,
            Cmd.HEARTBEAT: self._heartbeat,
            Cmd.TORQUES: self._torques,
            Cmd.TEMPERATURE: self._temperatures,
            Cmd.SUPPLY: self._supply,
            Cmd.VERSION: self._version,
            Cmd.ADDRESS: self._address,
            Cmd.TOLD: self._parameter,
        }

    def _axis(self, joint: Joint) -> _Axis:
        kind = joint.kind
        position, velocity = wire.gains(kind.kp / kind.ratio**2, kind.kd / kind.ratio**2)
        gains = wire.pack_gain(position), wire.pack_pair(velocity, 0.0)
        return _Axis(joint, self._buses[joint.bus], joint.id, Units(joint), *gains)

    @staticmethod
    def problems(dog: DogDescription) -> list[str]:
        """Return ids that no node has, stiffness without damping, and a watchdog that cannot be fed."""
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
    def load(drive: Drive, joints: int, bus: Bus) -> float:
        """Return what questions, answers and targets take; gains, while it is damped, take no more."""
        asked = frame_bits(0) + frame_bits(8)
        each = asked * (1 + 1 / _STATE_EVERY) + frame_bits(8)
        in_turn = asked + 2 * frame_bits(8) + frame_bits(4)
        return drive.cycle_hz * (joints * each + in_turn) / bus.bitrate

    @staticmethod
    def shared(dog: DogDescription) -> tuple[int, ...]:  # noqa: ARG004 - the same for each make
        """Return none: each drive has its own identifiers."""
        return ()

    @staticmethod
    def identifiers(drive: Drive, joint: Joint) -> tuple[int, ...]:  # noqa: ARG004 - the same for each make
        """Return the commands of the node."""
        return tuple(wire.identifier(joint.id, command) for command in Cmd)

    @staticmethod
    def farthest(joint: Joint, drive: Drive) -> float:  # noqa: ARG004 - the same for each make
        """Return how far its numbers are exact."""
        return wire.MOST_TURNS * wire.TURN

    @property
    def addresses(self) -> frozenset[Address]:
        """Each node's commands for a position and for a state."""
        orders = (Cmd.INPUT_POS, Cmd.STATE)
        return frozenset(
            (bus, wire.identifier(node, order)) for bus, node in self._by_node for order in orders
        )

    def configure(self) -> None:
        """Check that all drives answer with a firmware that is understood; set their watchdog."""
        for axis in self._axes:
            axis.restarted, axis.version = False, None
            axis.serials.clear()
            axis.parameters.clear()
        self._ask(lambda axis: wire.ask(axis.id, Cmd.VERSION), lambda axis: axis.version is not None)
        for axis in self._axes:
            version = axis.version or (0, 0)
            if version < wire.OLDEST:
                told = ".".join(map(str, version))
                raise LinkRefused(f"{axis.joint.name}: firmware {told}, wanted 0.6 or newer (command 00h)")
        self._ask(lambda axis: wire.ask(axis.id, Cmd.ADDRESS), lambda axis: bool(axis.serials))
        self._set_watchdog()

    def _set_watchdog(self) -> None:
        """Set the time-out and enable the watchdog, and read both back."""
        endpoints = self._dog.drive.endpoints
        if endpoints is None:
            log.warning(
                "ODrive: no drive.endpoints; see in odrivetool that axis0.config.enable_watchdog is true and "
                "watchdog_timeout %g s, or the drives go on when this computer dies",
                self._dog.drive.timeout,
            )
            return
        timeout = struct.pack("<f", self._dog.drive.timeout)
        for endpoint, value in ((endpoints.watchdog_timeout, timeout), (endpoints.enable_watchdog, _ON)):
            for axis in self._axes:
                self._send(axis, Cmd.PARAMETER, wire.write_parameter(endpoint, value))
            self._verify(endpoint, value)

    def _verify(self, endpoint: int, wanted: bytes) -> None:
        """Read a parameter of all drives; raises LinkRefused for one that is another."""

        def question(axis: _Axis) -> CanFrame:
            return CanFrame(wire.identifier(axis.id, Cmd.PARAMETER), wire.read_parameter(endpoint))

        self._ask(question, lambda axis: endpoint in axis.parameters)
        for axis in self._axes:
            actual = axis.parameters[endpoint][: len(wanted)]
            if actual != wanted:
                raise LinkRefused(
                    f"{axis.joint.name}: parameter {endpoint} (watchdog) is {actual.hex()}, not "
                    f"{wanted.hex()}; drive.endpoints must be those of its firmware"
                )

    def limit_torque(self, torque: float | None) -> None:
        """Keep targets so near that the drives' own stiffness pushes no harder."""
        self._most = torque

    def take(self, bus: str, frame: CanFrame, now: float) -> None:
        """Take a received frame."""
        node, command = wire.split(frame.id)
        axis = self._by_node.get((bus, node))
        takes = self._takes.get(command)
        if axis is not None and takes is not None:
            takes(axis, frame.data, now)

    def target(self, bus: str, frame: CanFrame) -> tuple[Joint, float] | None:
        """Return which joint a position command sends where."""
        node, command = wire.split(frame.id)
        axis = self._by_node.get((bus, node))
        told = wire.unpack_input(frame.data) if command == Cmd.INPUT_POS else None
        return None if axis is None or told is None else (axis.joint, axis.joint.angle(told[0]))

    def begin_cycle(self, now: float) -> None:  # noqa: ARG002 - every cycle is alike
        """Ask all drives where they are, some for their state, and one for something slow."""
        self._cycle += 1
        hurry = self._wanted is Power.ENABLED and not all(axis.held for axis in self._axes)
        for number, axis in enumerate(self._axes):
            axis.answers.begin()
            axis.bus.send(wire.ask(axis.id, Cmd.ESTIMATES))
            if hurry or (number + self._cycle) % _STATE_EVERY == 0 or axis.state is None:
                axis.bus.send(wire.ask(axis.id, Cmd.HEARTBEAT))
        turn, number = divmod(self._cycle, len(self._axes))
        axis = self._axes[number]
        axis.bus.send(wire.ask(axis.id, _SLOW[turn % len(_SLOW)]))

    def complete(self) -> bool:
        """Return True when each drive has told where it is."""
        return all(axis.answers.complete for axis in self._axes)

    def feedback(self, now: float) -> Joints:
        """Return what is known of the joints."""
        angles, speeds, torques, told, temperatures, voltages, restarted = zip(
            *map(_VALUES, self._axes), strict=True
        )
        powers, faults = zip(*[self._power(axis, now) for axis in self._axes], strict=True)
        ages = tuple([now - at for at in told])
        return Joints(angles, speeds, torques, powers, ages, temperatures, faults, voltages, restarted)

    def enable(self) -> None:
        """Ask for closed loop, with gains of zero; what is in it, is kept there without force."""
        step, self._geared = self._want(Power.ENABLED) % 3, 0
        for axis in self._axes:
            if axis.state == State.CLOSED_LOOP:
                self._here(axis)
            elif step == 0:
                self._send(axis, Cmd.MODES, wire.pack_modes())
                self._send(axis, Cmd.POS_GAIN, wire.pack_gain(0.0))
            elif step == 1:
                self._send(axis, Cmd.VEL_GAINS, wire.pack_pair(0.0, 0.0))
                self._here(axis)
            else:
                self._send(axis, Cmd.STATE, wire.pack_state(State.CLOSED_LOOP))

    def write(self, targets: Targets) -> None:
        """Send targets, and gains: to all drives at first, then to one in each cycle."""
        self._want(Power.ENABLED)
        for axis, angle, speed, torque in zip(self._axes, *targets, strict=True):
            nearer = near(axis.joint, axis.angle, angle, self._most)
            self._send(axis, Cmd.INPUT_POS, wire.pack_input(*axis.units.motor(nearer, speed, torque)))
        for axis in self._next_geared():
            self._send(axis, Cmd.MODES, wire.pack_modes())
            self._send(axis, Cmd.POS_GAIN, axis.position_gain)
            self._send(axis, Cmd.VEL_GAINS, axis.velocity_gains)

    def _next_geared(self) -> Sequence[_Axis]:
        """Return the drives whose gains are sent in this cycle: every second one at first, later one."""
        self._geared += 1
        if self._geared <= _GEARING:
            return self._axes[self._geared % 2 :: 2]
        number = self._cycle % len(self._axes)
        return self._axes[number : number + 1]

    def braking(self) -> str:
        """Return nothing: a drive in closed loop obeys."""
        return ""

    def probe(self, kd: float) -> bool:
        """Have what holds a dog give way: unfed, its watchdog would let it drop. The others only answer."""
        self.damp(kd)
        return True

    def lower(self, targets: Targets, kd: float) -> None:  # noqa: ARG002 - damping needs no targets
        """Give way with damping."""
        self.damp(kd)

    def damp(self, kd: float) -> None:
        """No stiffness, only damping. Gains do not feed the watchdog, positions do: they go in turn."""
        count, self._geared = self._want(Power.STOPPING), 0
        for axis in self._axes:
            if count % 2 == 0:
                _, velocity = wire.gains(0.0, kd / axis.joint.kind.ratio**2)
                self._send(axis, Cmd.POS_GAIN, wire.pack_gain(0.0))
                self._send(axis, Cmd.VEL_GAINS, wire.pack_pair(velocity, 0.0))
            if count % 2 == 1 or count == 0:
                self._here(axis)

    def quick_stop(self) -> None:
        """Damp as the description says: the drive's own emergency stop takes the torque off."""
        self.damp(self._dog.safety.kd)

    def disable(self) -> None:
        """Take the torque off."""
        self._want(Power.DISABLED)
        for axis in self._axes:
            self._send(axis, Cmd.STATE, wire.pack_state(State.IDLE))

    def reset_fault(self) -> None:
        """Clear errors."""
        for axis in self._axes:
            self._send(axis, Cmd.CLEAR, bytes(1))

    def _want(self, wanted: Power) -> int:
        """Note what is wanted of the drives; return for how many cycles it was before."""
        self._since = self._since + 1 if wanted is self._wanted else 0
        self._wanted = wanted
        return self._since

    def _here(self, axis: _Axis) -> None:
        """Send a drive to where it is; one that was never heard is sent nowhere."""
        if axis.told_at > NEVER:
            here = axis.units.motor(axis.angle, 0.0, 0.0)
            self._send(axis, Cmd.INPUT_POS, wire.pack_input(*here))

    def _power(self, axis: _Axis, now: float) -> tuple[Power, str]:
        """Return what a drive is doing, and its fault."""
        if axis.told_at == NEVER or axis.state is None:
            return Power.ABSENT, ""
        fault = self._fault(axis, now)
        if fault:
            return Power.FAULT, fault
        return (_CALLED[self._wanted] if axis.state == State.CLOSED_LOOP else Power.DISABLED), ""

    @staticmethod
    def _fault(axis: _Axis, now: float) -> str:
        """Return why a drive is not to be trusted, empty when it is."""
        number, state = axis.joint.id, axis.state
        if len(axis.serials) > 1:
            return f"two drives answer as id {number} on bus {axis.joint.bus}: give each its own"
        if axis.errors:
            return f"{wire.words(axis.errors)} (active errors {axis.errors:X}h)"
        if axis.restarted:
            return f"id {number} let go by itself (state 1); it is configured again after a reset"
        if now - axis.state_at > _STATE_AGE:
            return f"no heartbeat (command 01h) from id {number} for {now - axis.state_at:.2f} s"
        known = state in {State.UNDEFINED, State.IDLE, State.CLOSED_LOOP}
        return "" if known else f"id {number} is in state {state}, in which it moves its motor by itself"

    def _estimates(self, axis: _Axis, data: bytes, now: float) -> None:
        told = wire.unpack_pair(data)
        if told is None:
            return
        turns, speed = told
        angle, axis.speed, _ = axis.units.joint(turns * wire.TURN, speed * wire.TURN, 0.0)
        axis.angle, axis.told_at = angle, now
        axis.answers.take(data)

    def _heartbeat(self, axis: _Axis, data: bytes, now: float) -> None:
        """Take errors and state; notice a drive that lets go although nobody told it to."""
        told = wire.unpack_heartbeat(data)
        if told is None:
            return
        axis.errors, axis.state, axis.state_at = told.errors, told.state, now
        if self._wanted is Power.DISABLED:
            axis.held = False
        elif axis.state == State.CLOSED_LOOP:
            axis.held = True
        elif axis.held and not axis.errors:
            axis.restarted = True

    def _torques(self, axis: _Axis, data: bytes, _now: float) -> None:
        told = wire.unpack_pair(data)
        if told is not None:
            axis.torque = axis.units.joint(0.0, 0.0, told[1])[2]

    def _temperatures(self, axis: _Axis, data: bytes, _now: float) -> None:
        axis.temperature = wire.warmest(data)

    def _supply(self, axis: _Axis, data: bytes, _now: float) -> None:
        told = wire.unpack_pair(data)
        axis.voltage = told[0] if told else axis.voltage

    def _version(self, axis: _Axis, data: bytes, _now: float) -> None:
        axis.version = wire.unpack_version(data) or axis.version

    def _address(self, axis: _Axis, data: bytes, _now: float) -> None:
        """Note the serial number of a drive: two at one id are two drives."""
        if len(data) >= 7:
            axis.serials.add(data[1:7])

    def _parameter(self, axis: _Axis, data: bytes, _now: float) -> None:
        told = wire.unpack_parameter(data)
        if told is not None:
            axis.parameters[told[1]] = told[2]

    def _send(self, axis: _Axis, command: Cmd, data: bytes) -> None:
        axis.bus.send(CanFrame(wire.identifier(axis.id, command), data))

    def _ask(self, question: Callable[[_Axis], CanFrame], answered: Callable[[_Axis], bool]) -> None:
        ask_all(self._axes, self._buses, self.take, question, answered)
