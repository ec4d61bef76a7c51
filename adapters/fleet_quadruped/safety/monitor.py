"""Checks of every cycle that can stop the robot: drives, feedback, following, tilt, heat, battery."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from operator import ge, le

import msgspec

from fleet_quadruped.body.measured import MeasuredImu
from fleet_quadruped.drives.base import JointsFeedback, Power
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.names import Twelve
from fleet_quadruped.safety.stages import POSITIONED, UPRIGHT, BodyMode, StopStage, Trip

_ALONE = 3  # times the limit for which the joints of a single leg may be silent
# Times the maximum speed for the apparent change of an angle: a joint catches up after lost frames.
_FASTER = 2.0
_BEYOND = 0.1  # rad: tolerance of measured angles beyond the limits
_STUCK = 0.2  # rad: range of targets in which a joint may not move by a single count
_FROZEN = 0.3  # s for which the IMU of a walking robot may repeat a measurement bit for bit
_LASTS = 1.5  # s of low supply before it counts: a single odd value, or a moment under load, does not


class ObservedCycle(msgspec.Struct, frozen=True, gc=False):
    """One cycle: ``targets`` are the last written angles, ages are in s, ``voltage`` is the battery's."""

    mode: BodyMode
    joints: JointsFeedback
    targets: Twelve
    imu: MeasuredImu | None
    imu_age: float
    battery: float | None
    dt: float
    voltage: float | None = None


class Monitor:
    """Safety monitor of one robot; keeps the duration of following errors and low supplies."""

    def __init__(self, dog: DogDescription) -> None:
        self._dog = dog
        self._joints = joints = dog.all_joints
        self._far: dict[int, float] = {}  # s for which joints have been far from their targets
        self._angles = [0.0] * len(joints)
        self._quiet = [math.inf] * len(joints)  # s since the last measured angle
        self._sent: dict[int, tuple[float, float]] = {}  # range of targets since the last change of angle
        self._fastest = [_FASTER * joint.kind.velocity for joint in joints]
        self._lowest = [joint.low - _BEYOND for joint in joints]
        self._highest = [joint.high + _BEYOND for joint in joints]
        self._cool: tuple[float | None, ...] = ()  # the last temperatures, if none was near a limit
        self._stale = dog.safety.stale_cycles * dog.dt
        self._empty = self._sagging = 0.0  # s
        self._imu: MeasuredImu | None = None
        self._same = 0.0  # s for which the IMU has repeated its measurement

    def check(self, seen: ObservedCycle) -> Trip | None:
        """Return the trip with the hardest stage; None without one."""
        hardest: Trip | None = None
        for rule in _RULES:
            for trip in rule(self, seen):
                if hardest is None or trip.stage > hardest.stage:
                    hardest = trip
        return hardest

    def speed_share(self, joints: JointsFeedback) -> float:
        """Return the share of the speed that the temperatures permit: 1 when cool, 0.3 near the limit."""
        share = 1.0
        for joint, temperature in self._warm(joints.temperatures):
            warn, most = joint.kind.temperature_warn, joint.kind.temperature_max
            if temperature > warn:
                share = min(share, max(0.3, (most - temperature) / max(most - warn, 1e-3)))
        return share

    def _warm(self, temperatures: tuple[float | None, ...]) -> list[tuple[Joint, float]]:
        """Return the joints near a limit; temperatures seldom change, so harmless ones are cached."""
        if temperatures == self._cool:
            return []
        warm = [
            (joint, temperature)
            for joint, temperature in zip(self._joints, temperatures, strict=True)
            if temperature is not None
            and temperature >= min(joint.kind.temperature_warn, joint.kind.temperature_max)
        ]
        if not warm:
            self._cool = temperatures
        return warm

    def drives(self, seen: ObservedCycle) -> Iterator[Trip]:
        """Stop for a drive with a fault, or one that is not enabled."""
        joints = seen.joints
        if seen.mode is BodyMode.OFF or joints.all_enabled:
            return
        for joint, power, fault in zip(self._joints, joints.powers, joints.faults, strict=True):
            if power is Power.FAULT:
                yield Trip(StopStage.DAMP, f"{joint.name}: {fault or 'the drive reports a fault'}")
            elif power is not Power.ENABLED and seen.mode in POSITIONED:
                why = fault or f"wanted enabled, the drive is {power.value}"
                yield Trip(StopStage.DAMP, f"{joint.name}: {why}")

    def feedback(self, seen: ObservedCycle) -> Iterator[Trip]:
        """Stop if joints of two legs are silent, or one leg for longer."""
        most = self._stale
        if seen.mode is BodyMode.OFF or max(seen.joints.ages) <= most:
            return
        silent = [
            (joint, age) for joint, age in zip(self._joints, seen.joints.ages, strict=True) if age > most
        ]
        legs = {joint.name[:2] for joint, _ in silent}
        for joint, age in silent:
            if len(legs) > 1 or age > _ALONE * most:
                yield Trip(
                    StopStage.DAMP,
                    f"{joint.name}: no feedback from id {joint.id} on bus {joint.bus} for {age:.2f} s",
                )

    def following(self, seen: ObservedCycle) -> Iterator[Trip]:
        """Stop for a joint that does not follow its target."""
        safety, before = self._dog.safety, self._far
        most = safety.following * 0.98  # targets are clamped to the full distance
        places = zip(seen.targets, seen.joints.angles, strict=True)
        self._far = {
            number: before.get(number, 0.0) + seen.dt
            for number, (wanted, actual) in enumerate(places)
            if not -most <= wanted - actual <= most and seen.mode in POSITIONED
        }
        for number, lasts in self._far.items():
            if lasts > safety.following_time:
                wanted, actual = seen.targets[number], seen.joints.angles[number]
                yield Trip(
                    StopStage.DAMP,
                    f"{self._joints[number].name}: following error, "
                    f"wanted {wanted:.2f} rad, is at {actual:.2f}",
                )

    def encoders(self, seen: ObservedCycle) -> Iterator[Trip]:
        """Stop for an angle that changes faster than the joint can move, or not at all."""
        positioned, dt, joints, sent = seen.mode in POSITIONED, seen.dt, seen.joints, self._sent
        known = zip(joints.angles, joints.ages, self._angles, self._quiet, self._fastest, strict=True)
        for number, (angle, age, before, quiet, fastest) in enumerate(known):
            if age >= dt:
                self._quiet[number] = quiet + dt
                continue
            self._angles[number], self._quiet[number] = angle, 0.0
            if angle == before and positioned:
                yield from self._stuck(number, seen.targets[number])
                continue
            if number in sent:
                del sent[number]
            if positioned and abs(angle - before) > fastest * (quiet + dt):
                name = self._joints[number].name
                yield Trip(StopStage.DAMP, f"{name}: its encoder jumped from {before:.2f} to {angle:.2f} rad")

    def _stuck(self, number: int, target: float) -> Iterator[Trip]:
        """Stop for a joint whose targets move while its angle stays the same to the last count."""
        low, high = self._sent.get(number, (target, target))
        low, high = self._sent[number] = min(low, target), max(high, target)
        if high - low > _STUCK:
            name, angle = self._joints[number].name, self._angles[number]
            yield Trip(
                StopStage.DAMP,
                f"{name}: stays at exactly {angle:.3f} rad, wanted {low:.2f} to {high:.2f}: "
                "its encoder is stuck, or the joint is blocked",
            )

    def places(self, seen: ObservedCycle) -> Iterator[Trip]:
        """Stop for a joint that is measured outside its limits."""
        if seen.mode not in POSITIONED and seen.mode is not BodyMode.ENABLING:
            return
        joints = seen.joints
        if all(map(le, self._lowest, joints.angles)) and all(map(ge, self._highest, joints.angles)):
            return
        for joint, angle, power in zip(self._joints, joints.angles, joints.powers, strict=True):
            if power is not Power.ABSENT and not joint.low - _BEYOND <= angle <= joint.high + _BEYOND:
                yield Trip(
                    StopStage.DAMP,
                    f"{joint.name}: is at {angle:.2f} rad, outside its limits {joint.low:g} to "
                    f"{joint.high:g}: check its sign and offset",
                )

    def tilt(self, seen: ObservedCycle) -> Iterator[Trip]:
        """Stop for a robot that tips over, or has lost its IMU."""
        if self._dog.imu is None or seen.mode not in POSITIONED:
            return
        if seen.imu is None or seen.imu_age > self._dog.imu.timeout:
            yield Trip(StopStage.DAMP, f"imu: no valid frame for {seen.imu_age:.2f} s")
            return
        if seen.mode not in UPRIGHT:
            return
        self._same = self._same + seen.dt if seen.mode is BodyMode.WALKING and seen.imu == self._imu else 0.0
        self._imu = seen.imu
        if self._same > _FROZEN:
            yield Trip(StopStage.DAMP, f"imu: frozen, exactly the same for {self._same:.2f} s of walking")
        tilt, most = seen.imu.tilt, self._dog.safety.tilt
        if tilt > most:
            yield Trip(StopStage.DAMP, f"imu: tilted {tilt:.2f} rad, more than {most:g}")

    def heat(self, seen: ObservedCycle) -> Iterator[Trip]:
        """Sit down for an overheated joint."""
        for joint, temperature in self._warm(seen.joints.temperatures):
            most = joint.kind.temperature_max
            if temperature >= most:
                yield Trip(StopStage.SIT, f"{joint.name}: {temperature:.0f} C, {most:g} is its limit")

    def battery(self, seen: ObservedCycle) -> Iterator[Trip]:
        """Sit down for an empty battery."""
        battery = self._dog.battery
        if battery is None or seen.battery is None or seen.battery > battery.sit_at:
            self._empty = 0.0
            return
        self._empty += seen.dt
        if self._empty > _LASTS:
            yield Trip(StopStage.SIT, f"battery: {seen.battery:.0f} %, it sits down at {battery.sit_at:g} %")

    def supply(self, seen: ObservedCycle) -> Iterator[Trip]:
        """Sit down before the drives fail from undervoltage."""
        lowest = self._dog.safety.lowest_voltage
        if lowest is None:
            return
        voltages = seen.joints.voltages
        least = min([voltage for voltage in voltages if voltage is not None], default=seen.voltage)
        if least is None or least > lowest:
            self._sagging = 0.0
            return
        self._sagging += seen.dt
        if self._sagging > _LASTS:
            who = self._joints[voltages.index(least)].name if least in voltages else "battery"
            yield Trip(StopStage.SIT, f"{who}: supply at {least:.1f} V, it sits down at {lowest:g} V")


_RULES: tuple[Callable[[Monitor, ObservedCycle], Iterator[Trip]], ...] = (
    Monitor.drives,
    Monitor.feedback,
    Monitor.following,
    Monitor.encoders,
    Monitor.places,
    Monitor.tilt,
    Monitor.heat,
    Monitor.battery,
    Monitor.supply,
)
