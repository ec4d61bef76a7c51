"""Standing and walking: joint targets for a requested velocity."""

from __future__ import annotations

import math

from fleet_quadruped.body.balance import GRAVITY
from fleet_quadruped.body.gait import GaitSteps, Twist
from fleet_quadruped.body.legs import LegPoint
from fleet_quadruped.body.measured import BodyMeasurement, Targets
from fleet_quadruped.body.odometry import LegOdometry
from fleet_quadruped.body.pattern import trot, walk
from fleet_quadruped.body.velocity_ramp import limited, ramped, within
from fleet_quadruped.robot.description import DogDescription, leg_angles
from fleet_quadruped.robot.names import GaitName, Twelve

_INTEGRAL = 0.8  # 1/s: integral gain of the velocity loop, which compensates the legs' compliance
_CORRECTION = 0.25  # m/s and rad/s: largest correction by the velocity loop
_START_SHARE = 0.5  # share of an acceleration that the body leans into
_HEIGHT_SPEED = 0.1  # m/s


class Walker:
    """The gait with its velocity loop.

    ``speed_share`` below 1 slows a robot with hot drives down. ``gait``: requested gait, trot or walk.
    """

    def __init__(self, dog: DogDescription) -> None:
        self._dog = dog
        self._steps = GaitSteps(dog.gait, dog.legs, dog.geometry.foot_radius)
        self.odometry = LegOdometry(dog.legs, dog.geometry.foot_radius)
        self._ramped = Twist()
        self._added = Twist()
        self.height = dog.gait.height
        self.wanted_height = dog.gait.height
        self.speed_share = 1.0
        self.gait: GaitName = "trot"
        self._taken: GaitName = "trot"  # gait of the present steps
        self._last: Twelve | None = None
        self._patterns = {
            "trot": (trot(dog.gait), dog.gait),
            "walk": (walk(dog.gait, dog.legs), dog.gait.walk),
        }

    @property
    def walking(self) -> bool:
        """True while the gait is active."""
        return self._steps.walking

    def stand(self, height: float) -> None:
        """Reset, standing at this height."""
        self._steps.stand()
        self._ramped = self._added = Twist()
        self.height = self.wanted_height = height
        self._last = None

    def change_height(self, change: float) -> str:
        """Change the height by ``change`` (m), within the gait's limits; return why not, or ""."""
        if not math.isfinite(change):
            return f"{change} is not a height"
        gait = self._dog.gait
        self.wanted_height = max(gait.lowest, min(gait.highest, self.wanted_height + change))
        return ""

    @property
    def time_to_stand(self) -> float:
        """Longest time (s) until it stands with all feet in place, in its present gait."""
        return self._dog.time_to_stand(self._taken)

    def step(self, dt: float, wanted: Twist, sense: BodyMeasurement) -> Targets:
        """Return the joint targets after ``dt`` seconds; a change of gait waits until the robot stands."""
        pattern, pace = self._patterns[self.gait]
        if self._steps.choose(pattern):
            self._taken = self.gait
        else:
            wanted = Twist()
        self.odometry.update(dt, sense, self._steps.loads, self._steps.balance.speed)
        before = self._ramped
        goal = self._steps.feasible_velocity(limited(wanted, pace, self.speed_share))
        now = self._ramped = ramped(before, goal, pace, dt)
        self._correct(dt)
        most = _HEIGHT_SPEED * dt
        self.height += max(-most, min(most, self.wanted_height - self.height))
        added, seen = self._added, self.odometry.twist
        given = Twist(now.x + added.x, now.y + added.y, now.turn + added.turn)
        error = Twist(seen.x - now.x, seen.y - now.y)
        tilt = (sense.imu.roll, sense.imu.pitch) if sense.imu else (0.0, 0.0)
        feet = self._steps.step(dt, given, error, self.height, tilt=tilt, pull=_pull(dt, before, now))
        return self._targets(dt, feet, sense)

    def _correct(self, dt: float) -> None:
        """Integrate the velocity error while walking; reset when it stops."""
        if self._ramped.zero:
            self._added = Twist()
            return
        seen, wanted, added, share = self.odometry.twist, self._ramped, self._added, _INTEGRAL * dt
        self._added = Twist(
            within(added.x + share * (wanted.x - seen.x), _CORRECTION),
            within(added.y + share * (wanted.y - seen.y), _CORRECTION),
            within(added.turn + share * (wanted.turn - seen.turn), _CORRECTION),
        )

    def _targets(self, dt: float, feet: list[LegPoint], sense: BodyMeasurement) -> Targets:
        """Return the joint targets for the feet: angles, speeds, and torques that carry the weight."""
        angles: list[float] = []
        for leg, (x, y, z) in zip(self._dog.legs, feet, strict=True):
            angles += leg.angles((x - leg.x, y - leg.y, z))
        posture = tuple(angles)
        before = self._last or posture
        self._last = posture
        speeds = tuple([(now - then) / dt for now, then in zip(posture, before, strict=True)])
        return Targets(posture, speeds, self._carrying(sense))

    def _carrying(self, sense: BodyMeasurement) -> Twelve:
        """Return the torques that carry the weight on the standing feet and push the body over them."""
        weight = self._dog.robot.mass * GRAVITY
        ahead, aside = self._steps.balance.push(self.height)
        torques: list[float] = []
        reached = self.odometry.reached
        for number, (leg, load) in enumerate(zip(self._dog.legs, self._steps.loads, strict=True)):
            if not load:
                torques += (0.0, 0.0, 0.0)
                continue
            down = -weight * load
            _, (abad, hip, knee) = reached.get(number) or leg.reach(leg_angles(sense.angles, number))
            torques += (
                down * (aside * abad[1] + abad[2]),
                down * (ahead * hip[0] + aside * hip[1] + hip[2]),
                down * (ahead * knee[0] + aside * knee[1] + knee[2]),
            )
        return tuple(torques)


def _pull(dt: float, before: Twist, now: Twist) -> tuple[float, float]:
    """Return the acceleration (m/s2, forward and to the left) that the body leans into.

    Turning accelerates it all the time; a change of speed is over too soon for a full lean.
    """
    share = _START_SHARE / dt
    ahead, aside = (now.x - before.x) * share, (now.y - before.y) * share
    return ahead - now.turn * now.y, aside + now.turn * now.x
