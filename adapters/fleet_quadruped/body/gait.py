"""The trot: where the feet are to be, from a velocity, step by step of time.

Feet are in the body frame (m): diagonal legs swing together. Zero velocity for two whole cycles ends it
with all feet in their neutral places.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from fleet_quadruped.body.legs import Leg, Point
from fleet_quadruped.robot.parts import Gait

PHASES = (0.0, 0.5, 0.5, 0.0)  # of FL, FR, RL, RR
_FEEDBACK = 0.08  # s: how far a step reaches out against a wrong speed
_STUMBLE = 0.12  # rad of tilt at which a standing dog steps
_REST_CYCLES = 2.0


class Twist(NamedTuple):
    """Velocity in the body frame: m/s forward, m/s left, rad/s counter-clockwise."""

    x: float = 0.0
    y: float = 0.0
    turn: float = 0.0

    @property
    def zero(self) -> bool:
        """True when nothing is to move."""
        return abs(self.x) < 1e-4 and abs(self.y) < 1e-4 and abs(self.turn) < 1e-4


class Trot:
    """The feet of a walking or standing dog."""

    def __init__(self, gait: Gait, legs: Sequence[Leg], foot_radius: float) -> None:
        self._gait = gait
        self._legs = legs
        self._radius = foot_radius
        self._phase = 0.0
        self._rest = _REST_CYCLES
        self.feet = [self._neutral(leg, gait.height) for leg in legs]
        self._lifted = list(self.feet)
        self.stance = [True] * 4

    @property
    def walking(self) -> bool:
        """True while feet are lifted."""
        return self._rest < _REST_CYCLES

    def stand(self, height: float) -> None:
        """Put all feet in their neutral places at once (the dog has just stood up)."""
        self.feet = [self._neutral(leg, height) for leg in self._legs]
        self._phase, self._rest, self.stance = 0.0, _REST_CYCLES, [True] * 4

    def step(
        self, dt: float, wanted: Twist, error: Twist, height: float, tilt: tuple[float, float]
    ) -> list[Point]:
        """Return the feet after ``dt`` seconds.

        ``error`` is measured less wanted velocity; ``tilt`` is (roll, pitch), rad.
        """
        roll, pitch = tilt
        if not wanted.zero or max(abs(roll), abs(pitch)) > _STUMBLE:
            self._rest = 0.0 if self.walking else self._start()
        elif self.walking:
            self._rest += dt / self._gait.period
        if self.walking:
            self._phase = (self._phase + dt / self._gait.period) % 1.0
            for number in range(4):
                self._move(number, dt, wanted, error)
        else:
            self._settle(dt)
        return [self._levelled(number, height, roll, pitch) for number in range(4)]

    def _start(self) -> float:
        """Begin a cycle where the first diagonal lifts its feet."""
        self._phase = self._gait.duty
        return 0.0

    def _settle(self, dt: float) -> None:
        """Stand: let the feet creep to their neutral places while all of them are down."""
        share = min(1.0, dt / 0.3)
        for number, leg in enumerate(self._legs):
            x, y, _ = self.feet[number]
            goal = self._neutral(leg, self._gait.height)
            self.feet[number] = (x + (goal[0] - x) * share, y + (goal[1] - y) * share, goal[2])
        self.stance = [True] * 4

    def _neutral(self, leg: Leg, height: float) -> Point:
        return leg.x, leg.y + leg.side * leg.offset, -(height - self._radius)

    def _move(self, number: int, dt: float, wanted: Twist, error: Twist) -> None:
        """Move one foot: with the ground, or through the air to its next place."""
        phase = (self._phase + PHASES[number]) % 1.0
        x, y, _ = self.feet[number]
        if phase < self._gait.duty:
            self.stance[number] = True
            across = (x - (wanted.x - wanted.turn * y) * dt, y - (wanted.y + wanted.turn * x) * dt)
            self.feet[number] = (*across, 0.0)
            return
        if self.stance[number]:
            self.stance[number] = False
            self._lifted[number] = self.feet[number]
        share = (phase - self._gait.duty) / (1.0 - self._gait.duty)
        goal = self._goal(self._legs[number], wanted, error)
        start = self._lifted[number]
        smooth = share * share * (3 - 2 * share)
        self.feet[number] = (
            start[0] + (goal[0] - start[0]) * smooth,
            start[1] + (goal[1] - start[1]) * smooth,
            self._gait.swing * math.sin(math.pi * share),
        )

    def _goal(self, leg: Leg, wanted: Twist, error: Twist) -> tuple[float, float]:
        """Return where a foot is to come down: half a stance ahead of its neutral place."""
        x, y, _ = self._neutral(leg, self._gait.height)
        half = self._gait.period * self._gait.duty / 2
        ahead_x = (wanted.x - wanted.turn * y) * half + _FEEDBACK * error.x
        ahead_y = (wanted.y + wanted.turn * x) * half + _FEEDBACK * error.y
        length = math.hypot(ahead_x, ahead_y)
        share = min(1.0, self._gait.reach / length) if length > 0 else 1.0
        return x + ahead_x * share, y + ahead_y * share

    def _levelled(self, number: int, height: float, roll: float, pitch: float) -> Point:
        """Return a foot at its height; feet on the ground also level the body."""
        x, y, lift = self.feet[number]
        lift = max(0.0, lift) if self.walking else 0.0
        level = self._gait.posture * (roll * y - pitch * x) if self.stance[number] else 0.0
        return x, y, -(height - self._radius) + lift + max(-0.05, min(0.05, level))
