"""Motion of a simulated base: two sides that follow their set speeds with a lag, on a plane; pure.

The parameters are assumptions, chosen to be worse than a good base: a tracked base slips when it turns,
speeds are quantised, slow ones stick.
"""

from __future__ import annotations

import math
from random import Random

import msgspec

STEP = 0.01  # s of one step
BUMP = 0.3  # s that a push lasts


class BaseBody(msgspec.Struct, frozen=True):
    """Physical parameters of a base.

    ``track``: geometric, m; ``widening``: factor of the effective track; ``lag``: s until 63 % of a change;
    ``sticks``: m/s below which a side does not turn; ``fastest``: top speed of a side, m/s; ``bias`` and
    ``noise`` of the gyro, rad/s.
    """

    track: float
    widening: float = 1.0
    lag: float = 0.12
    sticks: float = 0.008
    fastest: float = 0.6
    bias: float = 0.01
    noise: float = 0.002


class Physics:
    """One base; ``x``, ``y`` (m) and ``yaw`` (rad) are its true pose."""

    def __init__(self, body: BaseBody, seed: int = 1) -> None:
        self.body = body
        self.x = self.y = self.yaw = 0.0
        self.speeds = [0.0, 0.0]  # of the sides, m/s
        self.distances = [0.0, 0.0]  # distances of the sides since the board started, m
        self.wanted = [0.0, 0.0]
        self.yaw_rate = 0.0
        self.speed = 0.0
        self.acceleration = 0.0
        self.stalled = False
        self.slip = 0.0
        self._pushes = 0
        self._push = 0.0
        self._random = Random(seed)  # noqa: S311 - repeatable on purpose

    def step(self) -> None:
        """Advance by one time step."""
        for side in (0, 1):
            self._follow(side)
        left, right = self.speeds
        grip = 1.0 - self.slip
        speed = (left + right) / 2 * grip
        self.yaw_rate = (right - left) / (self.body.track * self.body.widening) * grip
        self.acceleration = (speed - self.speed) / STEP
        self.speed = speed
        if self._pushes:
            self._pushes -= 1
            self.yaw_rate += self._push
        middle = self.yaw + self.yaw_rate * STEP / 2
        self.x += speed * math.cos(middle) * STEP
        self.y += speed * math.sin(middle) * STEP
        self.yaw = math.remainder(self.yaw + self.yaw_rate * STEP, math.tau)

    def _follow(self, side: int) -> None:
        """Move the speed of one side towards its set value."""
        wanted = min(max(self.wanted[side], -self.body.fastest), self.body.fastest)
        if abs(wanted) < self.body.sticks:
            wanted = 0.0
        if self.stalled:
            self.speeds[side] = 0.0
            return
        self.speeds[side] += (wanted - self.speeds[side]) * STEP / (self.body.lag + STEP)
        if wanted == 0.0 and abs(self.speeds[side]) < 0.002:
            self.speeds[side] = 0.0
        self.distances[side] += self.speeds[side] * STEP

    def bump(self, angle: float) -> None:
        """Turn the base without its wheels, within ``BUMP`` seconds."""
        self._pushes = round(BUMP / STEP)
        self._push = angle / BUMP

    def gyro(self) -> float:
        """Return what the gyro measures, rad/s."""
        return self.yaw_rate + self.body.bias + self._random.gauss(0.0, self.body.noise)

    def shake(self, size: float) -> float:
        """Return noise of this standard deviation."""
        return self._random.gauss(0.0, size)
