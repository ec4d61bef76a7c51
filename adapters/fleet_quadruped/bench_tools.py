"""Shared parts of the ``fleet can`` tools: a robot on the bench, with its drives only listened to."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from fleet import CanBus, CanFrame, Clock, LinkRefused, OpenCanBus
from fleet_quadruped.can.bus_guard import require_sole_controller
from fleet_quadruped.drives import drives_of
from fleet_quadruped.drives.base import HOLDING, JointFeedback, Power
from fleet_quadruped.drives.cia402.frames import HEARTBEAT, MASTER, RPDO1, SDO_REQUEST, SDO_RESPONSE, SYNC
from fleet_quadruped.drives.mit.frames import MitCommand, MitLayout
from fleet_quadruped.drives.mit.profiles import PROFILES
from fleet_quadruped.drives.moteus.frames import to_servo
from fleet_quadruped.frames import FrameDecoder
from fleet_quadruped.robot import parts
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.names import Twelve
from fleet_quadruped.selfwalk.controller import SelfWalkController
from fleet_quadruped.selfwalk.description import SelfWalker

_READ_DEVICE_TYPE = bytes.fromhex("4000100000000000")
_DAMPING = MitLayout(PROFILES["damiao-8006"]).pack_command(MitCommand(kd=3.0))
"""No stiffness, damping only (N m s/rad): the same bytes for every profile."""
_IDS = range(1, 128)
_ANSWERED = 0x43
_MOTORS = range(1, 16)
_ORDERS = frozenset(
    {*map(to_servo, _IDS), SYNC, HEARTBEAT + MASTER, *_MOTORS, *(RPDO1 + number for number in _IDS)}
)
"""Identifiers that only a controller sends, for any kind of drive."""


@contextlib.contextmanager
def open_buses(
    urls: Mapping[str, str], described: Mapping[str, parts.CanBusConfig], clock: Clock
) -> Iterator[dict[str, CanBus]]:
    """Open buses for the duration of a block; raises LinkLost or LinkRefused."""
    with contextlib.ExitStack() as stack:
        buses: dict[str, CanBus] = {}
        for name, url in urls.items():
            bus = OpenCanBus(name, url, described[name].bitrate, clock, described[name].data_bitrate)
            stack.callback(bus.close)
            buses[name] = bus
        yield buses


def scan(bus: CanBus, clock: Clock, seconds: float = 1.0) -> list[str]:
    """Return one line per device found; no request of the scan can move or change a device.

    CANopen nodes are asked for their device type (1000h). MIT motors receive a damping command, which a
    disabled motor only answers. It would disturb a controller: a bus with one is refused; raises LinkLost.
    """
    require_sole_controller({bus.name: bus}, {(bus.name, number) for number in _ORDERS}, clock)
    found: dict[tuple[str, int], str] = {}
    for number in _IDS:
        bus.send(CanFrame(SDO_REQUEST + number, _READ_DEVICE_TYPE))
        for frame in bus.receive(0.001):
            _note(frame, found)
    for number in _MOTORS:
        bus.send(CanFrame(number, _DAMPING))
    until = clock.monotonic() + seconds
    while clock.monotonic() < until:
        for frame in bus.receive(0.05):
            _note(frame, found)
    return [found[key] for key in sorted(found)]


def _note(frame: CanFrame, found: dict[tuple[str, int], str]) -> None:
    """Note the device that sent a frame."""
    node = frame.id & 0x7F
    if frame.id & ~0x7F == SDO_RESPONSE and len(frame.data) == 8:
        if frame.data[0] == _ANSWERED:
            profile = int.from_bytes(frame.data[4:6], "little")
            kind = "drive (CiA 402)" if profile == 402 else f"profile {profile}"
            found["canopen", node] = f"CANopen node {node}: {kind}"
        else:
            found.setdefault(("canopen", node), f"CANopen node {node}: refuses to report its device type")
    elif frame.id & ~0x7F == HEARTBEAT:
        found.setdefault(("canopen", node), f"CANopen node {node}: heartbeat, state {frame.data[:1].hex()}h")
    elif len(frame.data) in {6, 7, 8} and (frame.id == 0 or 0x10 < frame.id < 0x20):
        motor = frame.data[0] if frame.id == 0 else frame.id - 0x10
        found.setdefault(("mit", motor), f"MIT motor {motor}: answers on {frame.id:03X}h")


class BenchSession:
    """The configured drives of a robot, or of some joints; ``read_feedback`` keeps them disabled."""

    def __init__(
        self,
        dog: DogDescription,
        buses: Mapping[str, CanBus],
        clock: Clock,
        joints: Sequence[Joint] | None = None,
    ) -> None:
        self.dog = dog
        self.joints = dog.all_joints if joints is None else joints
        self.frames: Counter[str] = Counter()
        self._buses = buses
        self._clock = clock
        self.drives = drives_of(dog, buses, self.joints)
        require_sole_controller(buses, self.drives.addresses, clock)
        self.drives.configure()
        self._lower_if_held()

    def _lower_if_held(self) -> None:
        """Lower a robot that its motors may be holding; raises LinkRefused if it would fall.

        Without torque a robot drops if it stands, or if drives that stopped by themselves hold it.
        """
        safety = self.dog.safety
        compliant = held = False
        for _ in range(round(safety.damp_time / self.dog.dt)):
            reported = self.cycle(lambda: None)
            compliant = self.drives.probe(safety.kd)
            held = any(one.power in HOLDING for one in reported)
            if not held and all(one.power is not Power.ABSENT for one in reported):
                return
        if held and not compliant:
            raise LinkRefused(
                "the drives hold the dog, and it would fall: lower it with fleet run, or switch their power "
                "off while it hangs"
            )

    def read_feedback(self) -> tuple[JointFeedback, ...]:
        """Run one cycle with the torque off; return the feedback of the drives."""
        return self.cycle(self.drives.disable)

    def cycle(self, act: Callable[[], None]) -> tuple[JointFeedback, ...]:
        """Run one cycle: receive for one period, then ``act``; return the feedback of the drives."""
        now = self._clock.monotonic()
        self.drives.begin_cycle(now)
        until = now + self.dog.dt
        while (left := until - self._clock.monotonic()) > 0:
            for name, bus in self._buses.items():
                for frame in bus.receive(min(left, 0.002)):
                    self.frames[name] += 1
                    self.drives.handle_frame(name, frame, self._clock.monotonic())
        act()
        return self.drives.feedback(self._clock.monotonic()).each()

    def settle(self, cycles: int = 30) -> tuple[JointFeedback, ...]:
        """Return the feedback of the drives after some cycles with the torque off."""
        reported = self.read_feedback()
        for _ in range(cycles):
            reported = self.read_feedback()
        return reported


def problems(joints: Sequence[Joint], reported: tuple[JointFeedback, ...]) -> list[str]:
    """Return the reasons against enabling these joints, one line each."""
    found = []
    for joint, feedback in zip(joints, reported, strict=True):
        if feedback.age > 0.1:
            found.append(f"{joint.name}: id {joint.id} on bus {joint.bus!r} is silent")
        elif feedback.fault:
            found.append(f"{joint.name}: {feedback.fault}")
        elif not joint.low <= feedback.angle <= joint.high:
            found.append(
                f"{joint.name}: is at {feedback.angle:.2f} rad, outside {joint.low:g} to {joint.high:g}: "
                "check its sign and offset"
            )
    return found


def offsets(dog: DogDescription, reported: tuple[JointFeedback, ...], pose: Twelve) -> dict[str, float]:
    """Return the offset (rad) of each joint if the robot really is in ``pose``; assumes correct signs."""
    return {
        joint.name: round(joint.motor(feedback.angle) / joint.kind.ratio - joint.sign * angle, 4)
        for joint, feedback, angle in zip(dog.all_joints, reported, pose, strict=True)
    }


class MachineValues(NamedTuple):
    """Values of a self-walking machine by name, and one line for each missing frame."""

    values: dict[str, float]
    missing: list[str]


def listen(
    walker: SelfWalker, buses: Mapping[str, CanBus], clock: Clock, seconds: float = 1.0
) -> MachineValues:
    """Listen to a self-walking machine for a while; only requests for its state are sent."""
    controller = SelfWalkController(walker, buses)
    require_sole_controller(buses, controller.addresses, clock)
    if walker.wire.node is not None:
        controller.configure()
    decoder, bus = FrameDecoder((*walker.wire.state, *walker.wire.slow)), buses[walker.bus]
    values: dict[str, float] = {}
    heard: set[int] = set()
    until = clock.monotonic() + seconds
    while (now := clock.monotonic()) < until:
        controller.begin(now)
        for frame in bus.receive(walker.dt):
            heard.add(frame.id)
            values.update(decoder.decode(frame.id, frame.data) or {})
    missing = [
        f"frame {frame.id:03X}h ({', '.join(frame.fields)}) did not come"
        for frame in walker.wire.state
        if frame.id not in heard
    ]
    return MachineValues(values, missing)
