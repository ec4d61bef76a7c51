"""Trot and walk: where the feet are to be, from a velocity, step by step of time.

Feet are in the body frame (m). In the trot diagonal legs swing together. In the walk one leg swings at a
time, each side's rear leg before its front leg, and the body sways to the other side first, so that it is
always over the feet that stand. Zero velocity for two whole cycles ends either with all feet in their neutral
places.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import msgspec

from fleet_quadruped.body.legs import Leg, Point
from fleet_quadruped.robot.parts import Gait

_FEEDBACK = 0.08  # s: how far a step reaches out against a wrong speed
_STUMBLE = 0.12  # rad of tilt at which a standing dog steps
_REST_CYCLES = 2.0
_WALK_DUTY = 0.84  # 0.16 for each of four feet, and the rest to sway
_WALK_START = 0.97  # of a cycle: the body is aside before the first foot leaves the ground
_SWAY_IN, _SWAY_OUT = 8.0, 2.0  # shares of the sway that come into effect in a cycle, and out of it
_FLAT = 1.6  # how early the body is aside: 1 is a plain sine


class Twist(msgspec.Struct, frozen=True, gc=False):
    """Velocity in the body frame: m/s forward, m/s left, rad/s counter-clockwise."""

    x: float = 0.0
    y: float = 0.0
    turn: float = 0.0

    def __iter__(self) -> Iterator[float]:
        return iter((self.x, self.y, self.turn))

    @property
    def zero(self) -> bool:
        """True when nothing is to move."""
        return abs(self.x) < 1e-4 and abs(self.y) < 1e-4 and abs(self.turn) < 1e-4


class Pattern(NamedTuple):
    """When the feet of FL, FR, RL, RR are lifted: each at the share ``duty`` of its own cycle.

    ``start``: where in the cycle it begins. ``sway``: how far the body goes aside, m.
    """

    period: float
    duty: float
    phases: tuple[float, float, float, float]
    start: float
    sway: float = 0.0

    def shift(self, phase: float) -> float:
        """Return how far the body is to the left, as a share of the sway."""
        return -max(-1.0, min(1.0, _FLAT * math.sin(math.tau * phase))) if self.sway else 0.0


def trot(gait: Gait) -> Pattern:
    """Return the trot: fast, two feet on the ground."""
    return Pattern(gait.period, gait.duty, (0.0, 0.5, 0.5, 0.0), gait.duty)


def walk(gait: Gait) -> Pattern:
    """Return the walk: slow, three feet on the ground, statically stable."""
    lifts = (0.26, 0.76, 0.08, 0.58)
    front_left, front_right, rear_left, rear_right = (_WALK_DUTY - lift for lift in lifts)
    phases = (front_left, front_right, rear_left, rear_right)
    return Pattern(gait.walk.period, _WALK_DUTY, phases, _WALK_START, gait.walk.sway)


class Steps:
    """The feet of a walking or standing dog."""

    def __init__(self, gait: Gait, legs: Sequence[Leg], foot_radius: float) -> None:
        self._gait = gait
        self._neutral = [(leg.x, leg.y + leg.side * leg.offset) for leg in legs]
        self._radius = foot_radius
        self._pattern = trot(gait)
        self._phase = 0.0
        self._swaying = 0.0  # share of the sway that is in effect
        self._rest = _REST_CYCLES
        self.feet: list[Point] = [(x, y, 0.0) for x, y in self._neutral]
        self._lifted = list(self.feet)
        self.stance = [True] * 4

    @property
    def walking(self) -> bool:
        """True while feet are lifted."""
        return self._rest < _REST_CYCLES

    def choose(self, pattern: Pattern) -> bool:
        """Take a pattern from now on; False while the feet still move in another: stand first."""
        if self.walking and pattern != self._pattern:
            return False
        self._pattern = pattern
        return True

    def stand(self) -> None:
        """Put all feet in their neutral places at once (the dog has just stood up)."""
        self.feet = [(x, y, 0.0) for x, y in self._neutral]
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
            self._rest += dt / self._pattern.period
        self._sway(dt)
        if self.walking:
            self._phase = (self._phase + dt / self._pattern.period) % 1.0
            for number in range(4):
                self._move(number, dt, wanted, error)
        else:
            self._settle(dt)
        return self._levelled(height, roll, pitch)

    def _start(self) -> float:
        """Begin a cycle."""
        self._phase = self._pattern.start
        return 0.0

    def _sway(self, dt: float) -> None:
        """Bring the sway into effect while it walks, and out of it in its last cycle."""
        goal = 1.0 if self._rest < _REST_CYCLES - 1.0 else 0.0
        share = dt / self._pattern.period
        self._swaying += max(-_SWAY_OUT * share, min(_SWAY_IN * share, goal - self._swaying))

    def _settle(self, dt: float) -> None:
        """Stand: let the feet creep to their neutral places while all of them are down."""
        share = min(1.0, dt / 0.3)
        for number, (goal_x, goal_y) in enumerate(self._neutral):
            x, y, _ = self.feet[number]
            self.feet[number] = (x + (goal_x - x) * share, y + (goal_y - y) * share, 0.0)
        self.stance = [True] * 4

    def _move(self, number: int, dt: float, wanted: Twist, error: Twist) -> None:
        """Move one foot: with the ground, or through the air to its next place."""
        phase = (self._phase + self._pattern.phases[number]) % 1.0
        x, y, _ = self.feet[number]
        if phase < self._pattern.duty:
            self.stance[number] = True
            turn = wanted.turn
            self.feet[number] = (x - (wanted.x - turn * y) * dt, y - (wanted.y + turn * x) * dt, 0.0)
            return
        if self.stance[number]:
            self.stance[number] = False
            self._lifted[number] = self.feet[number]
        share = (phase - self._pattern.duty) / (1.0 - self._pattern.duty)
        goal = self._goal(number, wanted, error)
        start = self._lifted[number]
        smooth = share * share * (3 - 2 * share)
        self.feet[number] = (
            start[0] + (goal[0] - start[0]) * smooth,
            start[1] + (goal[1] - start[1]) * smooth,
            self._gait.swing * math.sin(math.pi * share),
        )

    def _goal(self, number: int, wanted: Twist, error: Twist) -> tuple[float, float]:
        """Return where a foot is to come down: half a stance ahead of its neutral place."""
        x, y = self._neutral[number]
        half = self._pattern.period * self._pattern.duty / 2
        ahead_x = (wanted.x - wanted.turn * y) * half + _FEEDBACK * error.x
        ahead_y = (wanted.y + wanted.turn * x) * half + _FEEDBACK * error.y
        length = math.hypot(ahead_x, ahead_y)
        share = min(1.0, self._gait.reach / length) if length > 0 else 1.0
        return x + ahead_x * share, y + ahead_y * share

    def _levelled(self, height: float, roll: float, pitch: float) -> list[Point]:
        """Return the feet at their height; those on the ground also level the body."""
        pattern, posture, ground = self._pattern, self._gait.posture, -(height - self._radius)
        aside = pattern.sway * pattern.shift(self._phase) * self._swaying
        feet: list[Point] = []
        for (x, y, lift), stands in zip(self.feet, self.stance, strict=True):
            level = posture * (roll * y - pitch * x) if stands else 0.0
            feet.append((x, y - aside, ground + lift + max(-0.05, min(0.05, level))))
        return feet
