"""Motion keys held together: their velocities add up, opposite ones cancel. Pure.

Each verb (``move_forward``, ``turn_left``, ...) is a key that is down for its own lease. The sum may be held
only until the first key expires, so no key outlives its lease because another is pressed.
"""

from __future__ import annotations

from fleet.model.geometry import Vector3, Velocity
from fleet.wire.verbs import VERBS

RELEASED = 0.15  # s before the end of its lease at which a key counts as up: no halt for the others


class HeldKeys:
    """Keys of one robot that are down."""

    def __init__(self) -> None:
        self._down: dict[str, tuple[Velocity, float]] = {}

    def press(self, verb: str, velocity: Velocity, now: float, lease: float) -> tuple[Velocity, float]:
        """Return the velocity to hold, and for how many seconds from ``now`` (monotonic).

        A velocity that is not from a key (a joystick, a contract) replaces all keys.
        """
        if verb not in VERBS:
            self.lift()
            return velocity, lease
        kept = {name: key for name, key in self._down.items() if key[1] - now > RELEASED}
        self._down = {**kept, verb: (velocity, now + lease)}
        until = min(until for _, until in self._down.values())
        return self._sum(), until - now

    def lift(self) -> None:
        """Release all keys."""
        self._down = {}

    def _sum(self) -> Velocity:
        """Combine the velocities axis by axis; opposite values on one axis give zero."""
        down = [velocity for velocity, _ in self._down.values()]
        return Velocity(
            Vector3(
                _added([one.linear.x for one in down]),
                _added([one.linear.y for one in down]),
                _added([one.linear.z for one in down]),
            ),
            _added([one.yaw_rate for one in down]),
        )


def _added(values: list[float]) -> float:
    """Return the value of largest magnitude, 0 when signs differ."""
    if min(values) < 0.0 < max(values):
        return 0.0
    return max(values, key=abs)
