"""Simulated robot: drives and sensors on buses, moved by a world, with faults by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from fleet import CanFrame
from fleet.sim.faults import check_fault
from fleet_quadruped.drives import SIMULATED_DRIVES, load_entry
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.sim.cia402 import SimDrive
from fleet_quadruped.sim.drive import AnyDrive, Hears
from fleet_quadruped.sim.faults import ALL_FAULTS, ON_CIA402, ON_DRIVE
from fleet_quadruped.sim.sensors import SENSOR_FAULTS, Sensors
from fleet_quadruped.sim.wires import BadBuses
from fleet_quadruped.sim.world import SimMotor, World

_LOOP = 0.01  # s, approximate control period of the drives, which interpolate in between


class SimDog:
    """A robot on buses. ``heard``: callback for the frames that it sends, by bus.

    ``seed`` determines the losses on bad wires.
    """

    def __init__(
        self,
        dog: DogDescription,
        world: World,
        heard: Mapping[str, Callable[[CanFrame], None]],
        seed: int = 1,
    ) -> None:
        self.dog = dog
        self._make: Callable[..., AnyDrive] = load_entry(SIMULATED_DRIVES, dog.drive.protocol)
        self.world = world
        self.time = 0.0
        self._heard = heard
        self._wires = BadBuses(dog.buses, seed)
        self._sensors = Sensors(dog, world)
        self._weak: list[SimMotor] = []
        self._senders = {bus: partial(self._say, bus) for bus in dog.buses}
        self._listeners: dict[str, dict[int, list[Hears]]] = {}
        self.drives: list[AnyDrive] = []
        for joint, motor in zip(dog.all_joints, world.motors, strict=True):
            self._add(joint, motor)
        self._listen()

    def fault(self, name: str, value: float = 1.0) -> None:
        """Activate a fault; raises ValueError for an unknown one."""
        check_fault(name, value, ALL_FAULTS)
        if ALL_FAULTS[name].startswith("joint"):
            if not 1 <= value <= len(self.dog.all_joints):
                raise ValueError(f"fault {name}: {value:g} is not a valid value ({ALL_FAULTS[name]})")
            self._fault_on(int(value) - 1, name)
        elif name in SENSOR_FAULTS:
            self._sensors.faults[name] = value
        elif name == "volts":
            self._sensors.voltage = value
            for drive in self.drives:
                drive.voltage = value
        else:
            self._wires.faults[name] = value

    def _fault_on(self, joint: int, name: str) -> None:
        """Activate a fault of one drive."""
        drive = self.drives[joint]
        if name == "twin":
            self._add(self.dog.all_joints[joint], SimMotor(angle=self.world.motors[joint].angle + 0.1))
        elif name == "weak":
            self._weak.append(self.world.motors[joint])
        elif name in ON_DRIVE:
            ON_DRIVE[name](drive)
        elif isinstance(drive, SimDrive):
            ON_CIA402[name](drive)
        else:
            raise ValueError(f"fault {name} is one of CiA 402 drives")
        self._listen()

    def _add(self, joint: Joint, motor: SimMotor) -> None:
        """Connect a drive to its bus."""
        drive = self._make(joint, motor, self._senders[joint.bus], self.dog.drive)
        self.drives.append(drive)

    def _listen(self) -> None:
        """Rebuild the table of receivers by identifier."""
        self._listeners = {bus: {} for bus in self.dog.buses}
        for drive in self.drives:
            for identifier, hears in drive.hears.items():
                self._listeners[drive.joint.bus].setdefault(identifier, []).append(hears)

    def clear(self, name: str) -> None:
        """Clear a fault of the wire, or of a sensor."""
        self._wires.faults.pop(name, None)
        self._sensors.faults.pop(name, None)

    def handle_frame(self, bus: str, frame: CanFrame) -> None:
        """Process a frame sent to the robot."""
        if not self._wires.faults:
            self._deliver(bus, frame)
            return
        for arrived in self._wires.to_dog(bus, [frame], self.time):
            self._deliver(bus, arrived)

    def advance(self, dt: float, *, sense: bool = True) -> None:
        """Advance by ``dt`` seconds; with ``sense``, send the sensor values at the end."""
        steps = max(1, round(dt / _LOOP))
        part = dt / steps
        for _ in range(steps):
            for drive in self.drives:
                drive.control(part)
            for motor in self._weak:
                motor.kp = motor.kd = motor.feed = 0.0
            self.world.step(part)
        self.world.measure()
        self.time += dt
        if sense:
            for bus, frame in self._sensors.frames(self.time):
                self._senders[bus](frame)
        if self._wires.faults:
            self._hand_over()

    def _hand_over(self) -> None:
        """Deliver the delayed frames of bad wires."""
        for bus in self.dog.buses:
            for frame in self._wires.to_dog(bus, (), self.time):
                self._deliver(bus, frame)
            for frame in self._wires.from_dog(bus, (), self.time):
                self._heard[bus](frame)

    def _deliver(self, bus: str, frame: CanFrame) -> None:
        for hears in self._listeners[bus].get(frame.id, ()):
            hears(frame)

    def _say(self, bus: str, frame: CanFrame) -> None:
        """Send a frame of the robot on a bus."""
        if not self._wires.faults:
            self._heard[bus](frame)
            return
        for arrived in self._wires.from_dog(bus, [frame], self.time):
            self._heard[bus](arrived)
