"""Comparison of a self-walking machine's reported velocity with the requested one."""

from __future__ import annotations

import math

from fleet_quadruped.body.gait import Twist

_REQUESTED, _TURN = 0.1, 0.2  # m/s, rad/s: slower requests are not compared
_SHARE = 0.25  # share of the request that it must report
_SLACK = 1.0  # s for reaching a velocity
_STILL, _STILL_TURN = 0.15, 0.3  # m/s, rad/s: tolerance while it should stand still
_HALT = 1.5  # s for coming to rest


class VelocityCheck:
    """Tracks how long a machine has not followed its requests. ``why``: description of it, or empty.

    ``runs``: description of a movement although it should stand still, or empty.
    """

    def __init__(self) -> None:
        self.why = self.runs = ""
        self._idle = self._running = 0.0  # s

    def check_cycle(self, dt: float, requested: Twist, reported: Twist) -> None:
        """Compare one cycle: requested and reported velocity (m/s, rad/s)."""
        still = requested == Twist()
        self._idle = self._idle + dt if not still and _idles(requested, reported) else 0.0
        moves = math.hypot(reported.x, reported.y) > _STILL or abs(reported.turn) > _STILL_TURN
        self._running = self._running + dt if still and moves else 0.0
        self.why = self.runs = ""
        if self._idle > _SLACK:
            words = f"requested {_words(requested)}, reports {_words(reported)}"
            self.why = f"{words}: it is blocked, or does not follow"
        if self._running > _HALT:
            self.runs = f"requested to stand still, reports {_words(reported)}"


def _idles(requested: Twist, reported: Twist) -> bool:
    """Return True if the reported velocity is much slower than requested, or opposite."""
    speed = math.hypot(requested.x, requested.y)
    along = (requested.x * reported.x + requested.y * reported.y) / speed if speed > _REQUESTED else math.inf
    turn = reported.turn * math.copysign(1.0, requested.turn) if abs(requested.turn) > _TURN else math.inf
    return along < _SHARE * speed or turn < _SHARE * abs(requested.turn)


def _words(twist: Twist) -> str:
    return f"{math.hypot(twist.x, twist.y):.2f} m/s and {twist.turn:.2f} rad/s"
