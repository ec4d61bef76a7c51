"""Description of a quadruped: the YAML file as a validated value."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

from pydantic import Field, model_validator

from fleet import ConfigError
from fleet_quadruped.body.legs import DogLeg, LegAngles
from fleet_quadruped.drives import drive_kind
from fleet_quadruped.robot.busload import HIGHEST, bus_loads
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.names import (
    EULER,
    JOINTS,
    LEGS,
    PARTS,
    QUATERNION,
    RATES,
    GaitName,
    Part,
    Twelve,
)
from fleet_quadruped.robot.parts import (
    Actuator,
    CanBusConfig,
    DogBattery,
    Drive,
    Gait,
    Geometry,
    LegPose,
    Machine,
    Poses,
    Safety,
    Section,
    Sensor,
    Switch,
    Wiring,
)
from fleet_quadruped.robot.reading import checked, read_tree

EXAMPLE = Path(__file__).parents[1] / "robots" / "example.yaml"


class DogDescription(Section):
    """Complete description of one quadruped."""

    robot: Machine
    geometry: Geometry
    buses: dict[str, CanBusConfig] = Field(min_length=1)
    drive: Drive
    actuators: dict[Part, Actuator]
    joints: dict[str, Wiring]
    gait: Gait = Gait()
    poses: Poses
    imu: Sensor | None = None
    battery: DogBattery | None = None
    led: Switch | None = None
    safety: Safety = Safety()

    @model_validator(mode="after")
    def _whole(self) -> DogDescription:
        """Refuse a description that the robot cannot walk with; the error has all problems."""
        problems = _protocol(self) or _missing(self) or _drives(self)
        problems = problems or [*_addresses(self), *_ranges(self), *_poses(self), *_loads(self), *_imu(self)]
        if problems:
            raise ValueError("; ".join(problems))
        return self

    @cached_property
    def all_joints(self) -> tuple[Joint, ...]:
        """The twelve joints in the order of ``JOINTS``."""
        return tuple(self._joint(name) for name in JOINTS)

    @cached_property
    def legs(self) -> tuple[DogLeg, ...]:
        """The four legs in the order of ``LEGS``."""
        return tuple(self._leg(name) for name in LEGS)

    @property
    def dt(self) -> float:
        """Control cycle in s."""
        return 1.0 / self.drive.cycle_hz

    @property
    def battery_timeout(self) -> float | None:
        """Age (s) at which a battery measurement is stale; None without a battery."""
        return self.battery.timeout if self.battery else None

    def time_to_stand(self, gait: GaitName) -> float:
        """Return the longest time (s) from a stop command to standing with all feet in place."""
        pace = self.gait if gait == "trot" else self.gait.walk
        return 2 * pace.period + pace.speed / pace.acceleration + 0.5

    @property
    def leave_time(self) -> float:
        """Longest time (s) from any gait, or a hard stop, until the drives are off, with a reserve."""
        slowest = max(self.time_to_stand("trot"), self.time_to_stand("walk"))
        return max(self.safety.damp_time, slowest + self.poses.sit_time) + 2.5

    @property
    def loads(self) -> dict[str, float]:
        """Load of each bus, as a share."""
        sensors = [sensor for sensor in (self.imu, self.battery) if sensor is not None]
        return bus_loads(
            self.drive, Counter(wiring.bus for wiring in self.joints.values()), sensors, self.buses
        )

    def posture(self, left: LegPose, right: LegPose | None = None) -> Twelve:
        """Return the angles of all joints for a pose of the left legs; ``right``: one for the right legs."""
        mirror = right or left
        one = (left.abad, left.hip, left.knee)
        two = (-mirror.abad, mirror.hip, mirror.knee)
        return tuple(angle for leg in LEGS for angle in (one if leg[1] == "L" else two))

    def stance(self, height: float) -> Twelve:
        """Return the joint angles for standing with the hips ``height`` metres above flat ground."""
        down = -(height - self.geometry.foot_radius)
        return tuple(angle for leg in self.legs for angle in leg.angles((0.0, leg.side * leg.offset, down)))

    def _joint(self, name: str) -> Joint:
        part: Part = next(part for part in PARTS if name.endswith(part))
        kind, wiring = self.actuators[part], self.joints[name]
        low, high = kind.limits
        if part == "abad" and name[1] == "R":
            low, high = -high, -low
        return Joint(name, wiring.bus, wiring.id, wiring.sign, wiring.offset, low, high, kind)

    def _leg(self, name: str) -> DogLeg:
        """Return the geometry of one leg: FL, FR, RL or RR."""
        shape = self.geometry
        knees = shape.front_knees if name[0] == "F" else shape.rear_knees
        side = 1 if name[1] == "L" else -1
        return DogLeg(
            x=shape.hip_x if name[0] == "F" else -shape.hip_x,
            y=side * shape.hip_y,
            side=side,
            knee=-1 if knees == "backward" else 1,
            offset=shape.abad_offset,
            thigh=shape.thigh,
            calf=shape.calf,
        )


def leg_angles(posture: Twelve, leg: int) -> LegAngles:
    """Return the three angles of one leg from all twelve."""
    return posture[3 * leg], posture[3 * leg + 1], posture[3 * leg + 2]


def _protocol(dog: DogDescription) -> list[str]:
    """Return a problem if no drive kind implements the protocol."""
    try:
        drive_kind(dog.drive.protocol)
    except ConfigError as error:
        return [f"drive.protocol: {error}"]
    return []


def _drives(dog: DogDescription) -> list[str]:
    """Return the settings that the drives do not support."""
    return drive_kind(dog.drive.protocol).problems(dog)


def _imu(dog: DogDescription) -> list[str]:
    """Return the values that the IMU's frames lack: an incomplete measurement would never be used."""
    if dog.imu is None:
        return []
    reported = {name for frame in dog.imu.frames for name in frame.fields}
    wanted = (EULER if reported & EULER and not reported & QUATERNION else QUATERNION) | RATES
    problems = [f"imu: {name} is in none of its frames" for name in sorted(wanted - reported)]
    if reported & EULER and reported & QUATERNION:
        problems.append("imu: it reports its attitude twice, as qw to qz and as roll, pitch, yaw; keep one")
    return problems


def _missing(dog: DogDescription) -> list[str]:
    """Return the joints, actuators and buses that are missing or unknown."""
    problems = [f"joints: {name} is missing" for name in JOINTS if name not in dog.joints]
    problems += [f"joints: there is no joint {name!r}" for name in dog.joints if name not in JOINTS]
    problems += [f"actuators: {part} is missing" for part in PARTS if part not in dog.actuators]
    users = {f"joints.{name}": wiring.bus for name, wiring in dog.joints.items()}
    users |= {
        name: part.bus for name in ("imu", "battery", "led") if (part := getattr(dog, name)) is not None
    }
    problems += [f"{user}: there is no bus {bus!r}" for user, bus in users.items() if bus not in dog.buses]
    return problems


def _addresses(dog: DogDescription) -> list[str]:
    """Return pairs of devices that use the same identifier on the same bus."""
    taken: dict[tuple[str, int], str] = {}
    problems: dict[tuple[str, str], str] = {}
    for name, bus, identifiers in _users(dog):
        for number in identifiers:
            other = taken.setdefault((bus, number), name)
            if other != name:
                both = f"{name} and {other} have the same frame {number:03X}h on bus {bus!r}"
                problems.setdefault((name, other), both)
    return list(problems.values())


def _users(dog: DogDescription) -> Iterator[tuple[str, str, tuple[int, ...]]]:
    """Yield name, bus and identifiers of the drive protocol, each drive, the sensors and the lamp."""
    kind = drive_kind(dog.drive.protocol)
    for bus in dict.fromkeys(joint.bus for joint in dog.all_joints):
        yield "the drives' protocol", bus, kind.shared(dog)
    for joint in dog.all_joints:
        yield f"joints.{joint.name} (id {joint.id})", joint.bus, kind.identifiers(dog.drive, joint)
    for name, sensor in (("imu", dog.imu), ("battery", dog.battery)):
        if sensor is not None:
            yield name, sensor.bus, tuple(frame.id for frame in sensor.frames)
    if dog.led is not None:
        yield "led", dog.led.bus, (dog.led.id,)


def _ranges(dog: DogDescription) -> list[str]:
    """Return the joints whose limits exceed the range of their drives' frames, which would saturate."""
    problems, kind = [], drive_kind(dog.drive.protocol)
    for joint in dog.all_joints:
        most = kind.farthest(joint, dog.drive)
        ends = sorted(map(joint.motor, (joint.low, joint.high)))
        if max(map(abs, ends)) > most:
            problems.append(
                f"{joint.name}: its limits are {ends[0]:.4g} to {ends[1]:.4g} rad of the motor, and its "
                f"drive's frames end at {most:.4g}; look at its ratio and its offset"
            )
    return problems


def _poses(dog: DogDescription) -> list[str]:
    """Return the configured heights and poses that the legs cannot reach."""
    gait, poses = dog.gait, dog.poses
    problems = []
    if not gait.lowest <= gait.height <= gait.highest:
        problems.append(f"gait: height {gait.height:g} is not between lowest and highest")
    for height in (gait.lowest, gait.height, gait.highest):
        down = -(height - dog.geometry.foot_radius)
        if not all(leg.reaches((0.0, leg.side * leg.offset, down)) for leg in dog.legs):
            problems.append(f"gait: the legs cannot stand at {height:g} m")
        problems += _outside(dog, f"standing at {height:g} m", dog.stance(height))
    problems += _outside(dog, "poses.fold", dog.posture(poses.fold))
    if (poses.roll_near is None) != (poses.roll_far is None):
        problems.append("poses: roll_near and roll_far belong together")
    if poses.roll_near and poses.roll_far:
        problems += _outside(dog, "poses.roll", dog.posture(poses.roll_near, poses.roll_far))
        problems += _outside(dog, "poses.roll mirrored", dog.posture(poses.roll_far, poses.roll_near))
    return problems


def _outside(dog: DogDescription, what: str, posture: Twelve) -> list[str]:
    """Return the joints that a posture would move beyond their limits."""
    margin = dog.safety.margin
    return [
        f"{what}: {joint.name} at {angle:.2f} rad is outside {joint.low:g} to {joint.high:g} less {margin:g}"
        for joint, angle in zip(dog.all_joints, posture, strict=True)
        if not joint.low + margin <= angle <= joint.high - margin
    ]


def _loads(dog: DogDescription) -> list[str]:
    """Return the buses with too high a load."""
    return [
        f"buses: {bus} would be {load:.0%} full, more than {HIGHEST:.0%}; "
        f"lower drive.cycle_hz or spread the joints over more buses"
        for bus, load in dog.loads.items()
        if load > HIGHEST
    ]


def load_description(path: Path) -> DogDescription:
    """Load the YAML file of a quadruped; raises ConfigError with all problems."""
    return checked(path, read_tree(path), DogDescription)
