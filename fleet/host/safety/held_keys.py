"""Keys that are held together: their velocities add up, opposite ones cancel; pure.

Each verb (``move_forward``, ``turn_left``, ...) is a key that is down for its own lease. The sum may be held
only until the first of its keys is due, so no key outlives its lease because another is pressed.
"""

from __future__ import annotations

from fleet.model.geometry import Vector3, Velocity
from fleet.wire.verbs import VERBS

RELEASED = 0.15  # s before the end of its lease at which a key counts as up: the others go on without a halt


class HeldKeys:
    """The keys of one robot that are down."""

    def __init__(self) -> None:
        self._down: dict[str, tuple[Velocity, float]] = {}

    def press(self, verb: str, velocity: Velocity, now: float, lease: float) -> tuple[Velocity, float]:
        """Return what to hold, and for how many seconds from ``now`` (monotonic).

        What is no key (a joystick, a contract) stands alone and lifts all keys.
        """
        if verb not in VERBS:
            self.lift()
            return velocity, lease
        kept = {name: key for name, key in self._down.items() if key[1] - now > RELEASED}
        self._down = {**kept, verb: (velocity, now + lease)}
        until = min(until for _, until in self._down.values())
        return self._sum(), until - now

    def lift(self) -> None:
        """All keys are up."""
        self._down = {}

    def _sum(self) -> Velocity:
        """Add up, axis by axis; an axis that is pulled both ways stands."""
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
    """Return the value that is largest, 0 when some pull the other way."""
    if min(values) < 0.0 < max(values):
        return 0.0
    return max(values, key=abs)
