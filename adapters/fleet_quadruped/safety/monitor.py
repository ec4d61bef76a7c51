"""Looks at every cycle for reasons to stop: drives, feedback, following, tilt, heat, battery."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

from fleet_quadruped.body.sense import Imu
from fleet_quadruped.drives.base import JointFeedback, Power
from fleet_quadruped.robot.description import Description
from fleet_quadruped.robot.names import Twelve
from fleet_quadruped.safety.stages import POSITIONED, UPRIGHT, Mode, Stage, Trip

_ALONE = 3  # times the limit that a joint of one leg only may be silent
_FASTER = 1.5  # times the highest speed that an angle may seem to change
_BEYOND = 0.1  # rad a joint may be measured outside its limits


class Observed(NamedTuple):
    """One cycle: ``targets`` are the angles last written; ages in seconds."""

    mode: Mode
    joints: tuple[JointFeedback, ...]
    targets: Twelve
    imu: Imu | None
    imu_age: float
    battery: float | None
    dt: float


class Monitor:
    """Remembers how long each joint has been far from its target."""

    def __init__(self, dog: Description) -> None:
        self._dog = dog
        self._far = [0.0] * len(dog.all_joints)
        self._angles = [0.0] * len(dog.all_joints)
        self._quiet = [math.inf] * len(dog.all_joints)  # s since the angle was told

    def check(self, seen: Observed) -> Trip | None:
        """Return the hardest reason to stop; None when there is none."""
        hardest: Trip | None = None
        for rule in _RULES:
            for trip in rule(self, seen):
                if hardest is None or trip.stage > hardest.stage:
                    hardest = trip
        return hardest

    def speed_share(self, joints: tuple[JointFeedback, ...]) -> float:
        """Return how much of its speed a warm dog may use: 1 when cool, 0.3 near its limit."""
        share = 1.0
        for joint, told in zip(self._dog.all_joints, joints, strict=True):
            warn, most = joint.kind.temperature_warn, joint.kind.temperature_max
            if told.temperature is not None and told.temperature > warn:
                share = min(share, max(0.3, (most - told.temperature) / max(most - warn, 1e-3)))
        return share

    def drives(self, seen: Observed) -> Iterator[Trip]:
        """Stop for a fault of a drive, or one that no longer obeys."""
        if seen.mode is Mode.OFF:
            return
        for joint, told in zip(self._dog.all_joints, seen.joints, strict=True):
            if told.power is Power.FAULT:
                yield Trip(Stage.DAMP, f"{joint.name}: {told.fault or 'the drive reports a fault'}")
            elif seen.mode in POSITIONED and told.power is not Power.ENABLED:
                why = told.fault or f"wanted enabled, the drive is {told.power.value}"
                yield Trip(Stage.DAMP, f"{joint.name}: {why}")

    def feedback(self, seen: Observed) -> Iterator[Trip]:
        """Stop when joints of two legs are silent, or one for longer."""
        if seen.mode is Mode.OFF:
            return
        most = self._dog.safety.stale_cycles * self._dog.dt
        if max(told.age for told in seen.joints) <= most:
            return
        ages = zip(self._dog.all_joints, (told.age for told in seen.joints), strict=True)
        silent = [(joint, age) for joint, age in ages if age > most]
        legs = {joint.name[:2] for joint, _ in silent}
        for joint, age in silent:
            if len(legs) > 1 or age > _ALONE * most:
                yield Trip(
                    Stage.DAMP,
                    f"{joint.name}: no feedback from id {joint.id} on bus {joint.bus} for {age:.2f} s",
                )

    def following(self, seen: Observed) -> Iterator[Trip]:
        """Stop for a joint that does not go where it is sent."""
        safety = self._dog.safety
        if seen.mode not in POSITIONED:
            self._far = [0.0] * len(self._far)
            return
        most = safety.following * 0.98  # targets are kept within it
        for number, (wanted, told) in enumerate(zip(seen.targets, seen.joints, strict=True)):
            actual = told.angle
            if -most <= wanted - actual <= most:
                self._far[number] = 0.0
                continue
            self._far[number] += seen.dt
            if self._far[number] > safety.following_time:
                joint = self._dog.all_joints[number]
                yield Trip(
                    Stage.DAMP, f"{joint.name}: following error, wanted {wanted:.2f} rad, is at {actual:.2f}"
                )

    def jumps(self, seen: Observed) -> Iterator[Trip]:
        """Stop for an angle that changes faster than the joint can turn."""
        for number, (joint, told) in enumerate(zip(self._dog.all_joints, seen.joints, strict=True)):
            self._quiet[number] += seen.dt
            if told.age >= seen.dt:
                continue
            moved = abs(told.angle - self._angles[number])
            fast = moved > _FASTER * joint.kind.velocity * self._quiet[number]
            before, self._angles[number], self._quiet[number] = self._angles[number], told.angle, 0.0
            if fast and seen.mode in POSITIONED:
                yield Trip(
                    Stage.DAMP,
                    f"{joint.name}: its encoder jumped from {before:.2f} to {told.angle:.2f} rad",
                )

    def places(self, seen: Observed) -> Iterator[Trip]:
        """Stop for a joint that is measured where it cannot be."""
        if seen.mode not in POSITIONED and seen.mode is not Mode.ENABLING:
            return
        for joint, told in zip(self._dog.all_joints, seen.joints, strict=True):
            if told.power is Power.ABSENT:
                continue
            if not joint.low - _BEYOND <= told.angle <= joint.high + _BEYOND:
                yield Trip(
                    Stage.DAMP,
                    f"{joint.name}: is at {told.angle:.2f} rad, outside its limits {joint.low:g} to "
                    f"{joint.high:g}: check its sign and offset",
                )

    def tilt(self, seen: Observed) -> Iterator[Trip]:
        """Stop for a dog that falls, or no longer knows whether it does."""
        if self._dog.imu is None or seen.mode not in UPRIGHT:
            return
        if seen.imu is None or seen.imu_age > self._dog.imu.timeout:
            yield Trip(Stage.DAMP, f"imu: no valid frame for {seen.imu_age:.2f} s")
            return
        angle = math.acos(max(-1.0, min(1.0, seen.imu.up)))
        if angle > self._dog.safety.tilt:
            yield Trip(Stage.DAMP, f"imu: tilted {angle:.2f} rad, more than {self._dog.safety.tilt:g}")

    def heat(self, seen: Observed) -> Iterator[Trip]:
        """Sit down for a hot joint."""
        for joint, told in zip(self._dog.all_joints, seen.joints, strict=True):
            if told.temperature is not None and told.temperature >= joint.kind.temperature_max:
                yield Trip(
                    Stage.SIT,
                    f"{joint.name}: {told.temperature:.0f} C, {joint.kind.temperature_max:g} is its limit",
                )

    def battery(self, seen: Observed) -> Iterator[Trip]:
        """Sit down for an empty battery."""
        battery = self._dog.battery
        if battery is not None and seen.battery is not None and seen.battery <= battery.sit_at:
            yield Trip(Stage.SIT, f"battery: {seen.battery:.0f} %, it sits down at {battery.sit_at:g} %")


_RULES: tuple[Callable[[Monitor, Observed], Iterator[Trip]], ...] = (
    Monitor.drives,
    Monitor.feedback,
    Monitor.following,
    Monitor.jumps,
    Monitor.places,
    Monitor.tilt,
    Monitor.heat,
    Monitor.battery,
)
