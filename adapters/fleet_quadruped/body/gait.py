"""Trot and walk: positions of the feet for a velocity, advanced in time steps.

Feet are in the body frame (m). In the trot, diagonal legs swing together. In the walk one leg swings at a
time, the rear leg of each side before its front leg; the body sways to the other side first, so that the
centre of pressure lies between the standing feet. Zero velocity ends either gait at the end of a half cycle,
once each foot has been lifted once more and all are in their neutral positions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import msgspec

from fleet_quadruped.body.balance import Balance, GroundPoint, inside, loads
from fleet_quadruped.body.legs import DogLeg, LegPoint
from fleet_quadruped.body.pattern import Pattern, trot
from fleet_quadruped.robot.parts import Gait

_FEEDBACK = 0.08  # s: correction of a step per m/s of velocity error
_STUMBLE = 0.12  # rad: tilt at which a standing robot takes steps
_REST_CYCLES = 0.5  # cycles at zero velocity before the last half cycle: each foot is lifted once more
_MIDDLE = (0.0, 0.0)


class Twist(msgspec.Struct, frozen=True, gc=False):
    """Velocity in the body frame: m/s forward, m/s left, rad/s counter-clockwise."""

    x: float = 0.0
    y: float = 0.0
    turn: float = 0.0

    def __iter__(self) -> Iterator[float]:
        return iter((self.x, self.y, self.turn))

    @property
    def zero(self) -> bool:
        """True if the velocity is practically zero."""
        return abs(self.x) < 1e-4 and abs(self.y) < 1e-4 and abs(self.turn) < 1e-4


class GaitSteps:
    """Feet of a walking or standing robot, and the position of its body over them.

    ``loads``: share of the weight on each foot.
    """

    def __init__(self, gait: Gait, legs: Sequence[DogLeg], foot_radius: float) -> None:
        self._gait = gait
        self._neutral = [(leg.x, leg.y + leg.side * leg.offset) for leg in legs]
        self._radius = foot_radius
        self._pattern = trot(gait)
        self._phase = 0.0
        self._rest = 0.0  # cycles since the last non-zero velocity
        self._lifts = False  # feet leave the ground
        self._last = False  # the gait ends after this half cycle
        self.walking = False
        self.balance = Balance()
        self.feet: list[LegPoint] = [(x, y, 0.0) for x, y in self._neutral]
        self._lifted = list(self.feet)
        self.stance = [True] * 4
        self.loads = [0.25] * 4

    def choose(self, pattern: Pattern) -> bool:
        """Switch to a pattern; return False while the feet still move in another one: stand first."""
        if self.walking and pattern != self._pattern:
            return False
        self._pattern = pattern
        return True

    def stand(self) -> None:
        """Put all feet in their neutral positions at once, after standing up."""
        self.feet = [(x, y, 0.0) for x, y in self._neutral]
        self._phase, self.walking, self.stance = 0.0, False, [True] * 4
        self.balance = Balance()

    def feasible_velocity(self, wanted: Twist) -> Twist:
        """Return the largest velocity in this direction that leaves no standing foot too far behind.

        A foot that was placed for another velocity cannot correct its position before its next lift.
        """
        if self._pattern.reach is None or not self.walking:
            return wanted
        share, (long, wide) = 1.0, self._pattern.reach
        for (x, y, _), (home_x, home_y), phase in zip(
            self.feet, self._neutral, self._pattern.phases, strict=True
        ):
            left = self._left(phase)
            at_x, at_y = (x - home_x) / long, (y - home_y) / wide
            go_x, go_y = (
                (wanted.turn * y - wanted.x) * left / long,
                (-wanted.turn * x - wanted.y) * left / wide,
            )
            if left > 0.0 and math.hypot(at_x + go_x, at_y + go_y) > 1.0:
                share = min(share, _until(at_x, at_y, go_x, go_y))
        return Twist(wanted.x * share, wanted.y * share, wanted.turn * share)

    def _left(self, phase: float) -> float:
        """Return the time (s) that a foot with this phase stays on the ground, 0 for one in the air."""
        left = self._pattern.duty - (self._phase + phase) % 1.0
        if not self._lifts and left < 0.5 - self._phase % 0.5:
            left += 1.0
        return max(0.0, left) * self._pattern.period

    def step(
        self,
        dt: float,
        wanted: Twist,
        error: Twist,
        height: float,
        *,
        tilt: tuple[float, float],
        pull: tuple[float, float] = (0.0, 0.0),
    ) -> list[LegPoint]:
        """Return the feet after ``dt`` seconds.

        ``error``: measured minus requested velocity; ``tilt``: (roll, pitch), rad; ``pull``: requested
        acceleration, m/s2.
        """
        roll, pitch = tilt
        moving = not wanted.zero or max(abs(roll), abs(pitch)) > _STUMBLE
        self._rest = 0.0 if moving else self._rest + dt / self._pattern.period
        if self.walking:
            self._advance(dt / self._pattern.period)
        elif moving:
            self._start()
        self._sway(dt, height, pull)
        if self.walking:
            for number in range(4):
                self._move(number, dt, wanted, error)
        else:
            self._settle(dt)
        self.loads = loads(self.feet, self.stance, self.balance.place)
        return self._levelled(height, roll, pitch)

    def _start(self) -> None:
        """Begin a cycle."""
        self._phase, self._lifts, self._last = self._pattern.start, not self._pattern.sway, False
        self.walking = True

    def _advance(self, share: float) -> None:
        """Advance by a share of a cycle; at the end of a half cycle the gait may end, with all feet down."""
        half = self._phase < 0.5
        self._phase = (self._phase + share) % 1.0
        if (self._phase < 0.5) is half:
            return
        self._lifts = True
        self.walking = not self._last
        self._last = self._rest >= _REST_CYCLES

    def _sway(self, dt: float, height: float, pull: tuple[float, float]) -> None:
        """Move the body over the standing feet of this half cycle, and towards those of the next."""
        pattern, place, goal = self._pattern, _MIDDLE, _MIDDLE
        if self.walking and pattern.sway:
            side = 1 if self._phase < 0.5 else 0
            place = self._support_centre(side, rear=self._phase % 0.5 < 0.25) if self._lifts else _MIDDLE
            goal = _MIDDLE if self._last else self._support_centre(1 - side, rear=True)
        left = (0.5 - self._phase % 0.5) * pattern.period
        self.balance.step(dt, height, place, goal, left=left, pull=pull)

    def _support_centre(self, side: int, *, rear: bool) -> GroundPoint:
        """Return the centre of pressure for standing on both feet of a side (0 left) and one of the other.

        ``rear``: the other side's rear foot is lifted, else its front foot.
        """
        front, back, away = self.feet[side], self.feet[side + 2], self.feet[(1 if rear else 3) - side]
        neutral = self._neutral[side][1]
        y = (front[1] + back[1]) / 2 - neutral * (1.0 - self._pattern.sway)
        place = ((front[0] + back[0]) / 2, y)
        return inside(place, back, away, front) if rear else inside(place, front, away, back)

    def _settle(self, dt: float) -> None:
        """Stand: let the feet slip slowly to their neutral positions, with all of them down."""
        share = min(1.0, dt / 0.3)
        for number, (goal_x, goal_y) in enumerate(self._neutral):
            x, y, _ = self.feet[number]
            self.feet[number] = (x + (goal_x - x) * share, y + (goal_y - y) * share, 0.0)
        self.stance = [True] * 4

    def _move(self, number: int, dt: float, wanted: Twist, error: Twist) -> None:
        """Move one foot: with the ground, or through the air to its next position.

        At lift-off and touch-down its horizontal speed equals that of the ground.
        """
        phase = (self._phase + self._pattern.phases[number]) % 1.0
        x, y, _ = self.feet[number]
        if phase < self._pattern.duty or not self._lifts:
            self.stance[number] = True
            turn = wanted.turn
            self.feet[number] = (x - (wanted.x - turn * y) * dt, y - (wanted.y + turn * x) * dt, 0.0)
            return
        if self.stance[number]:
            self.stance[number] = False
            self._lifted[number] = self.feet[number]
        air = 1.0 - self._pattern.duty
        share = (phase - self._pattern.duty) / air
        goal, start, (home_x, home_y) = (
            self._goal(number, wanted, error),
            self._lifted[number],
            self._neutral[number],
        )
        smooth = share * share * (3 - 2 * share)
        with_ground = (smooth - share) * air * self._pattern.period
        self.feet[number] = (
            start[0] + (goal[0] - start[0]) * smooth + (wanted.x - wanted.turn * home_y) * with_ground,
            start[1] + (goal[1] - start[1]) * smooth + (wanted.y + wanted.turn * home_x) * with_ground,
            self._gait.swing * math.sin(math.pi * share),
        )

    def _goal(self, number: int, wanted: Twist, error: Twist) -> tuple[float, float]:
        """Return the touch-down position of a foot: half a stance ahead of its neutral position."""
        x, y = self._neutral[number]
        half = self._pattern.period * self._pattern.duty / 2
        ahead_x = (wanted.x - wanted.turn * y) * half + _FEEDBACK * error.x
        ahead_y = (wanted.y + wanted.turn * x) * half + _FEEDBACK * error.y
        length = math.hypot(ahead_x, ahead_y)
        share = min(1.0, self._gait.reach / length) if length > 0 else 1.0
        return x + ahead_x * share, y + ahead_y * share

    def _levelled(self, height: float, roll: float, pitch: float) -> list[LegPoint]:
        """Return the feet relative to the body at its height; feet on the ground also level the body."""
        posture, ground, ahead, aside = (
            self._gait.posture,
            self._radius - height,
            self.balance.x,
            self.balance.y,
        )
        feet: list[LegPoint] = []
        for (x, y, lift), stands in zip(self.feet, self.stance, strict=True):
            level = posture * (roll * y - pitch * x) if stands else 0.0
            feet.append((x - ahead, y - aside, ground + lift + max(-0.05, min(0.05, level))))
        return feet


def _until(at_x: float, at_y: float, go_x: float, go_y: float) -> float:
    """Return the share of a step that takes a point to the unit circle; 0 if it never gets there."""
    square, along = go_x * go_x + go_y * go_y, at_x * go_x + at_y * go_y
    under = along * along - square * (at_x * at_x + at_y * at_y - 1.0)
    return max(0.0, (math.sqrt(under) - along) / square) if under > 0.0 else 0.0
