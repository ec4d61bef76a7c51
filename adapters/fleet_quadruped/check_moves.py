"""Small moves of ``fleet can check --move``: sends a controller its orders and collects observations."""

from __future__ import annotations

from collections.abc import Callable

from fleet import Clock, Quaternion
from fleet_quadruped.body.probing import HOLD_TIME, look_times
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.commissioning import Observation
from fleet_quadruped.control.orders import Activity, DogState, Order
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.safety.stages import BodyMode

_HEARD = 0.3  # s until every drive and the IMU have sent feedback
_REQUESTED = Activity(1, BodyRequest.CHECK)


class CheckMoves:
    """Source of orders and sink of states for one check.

    ``interrupted`` is polled in every cycle; True is an emergency stop by the person at the bench. ``looks``
    holds the observations; ``ended`` is the reason of an early end, empty after a complete check.
    """

    def __init__(self, dog: DogDescription, clock: Clock, interrupted: Callable[[], bool]) -> None:
        self.looks: list[Observation] = []
        self.ended = ""
        self._times = look_times(dog)
        self._clock = clock
        self._interrupted = interrupted
        self._began_at = clock.monotonic()
        self._moving: float | None = None  # monotonic s of the first state in the check
        self._stop = 0
        self._leave = False

    def order(self) -> Order:
        """Return the newest order."""
        now = self._clock.monotonic()
        if self._interrupted():
            self._stop = 1
        activity = _REQUESTED if now - self._began_at > _HEARD else Activity()
        return Order(alive=now, activity=activity, stop=self._stop, leave=self._leave)

    def put(self, state: DogState) -> None:
        """Record an observation whenever the trunk has come to rest; leave when the check is over."""
        if state.mode == BodyMode.CHECKING:
            self._moving = state.stamp if self._moving is None else self._moving
            self._observe(state, state.stamp - self._moving)
        elif state.answered and state.mode == BodyMode.OFF:
            self.ended = self.ended or state.refusal or state.fault
            self._leave = True

    def _observe(self, state: DogState, passed: float) -> None:
        """Record one observation towards the end of each pause."""
        number = len(self.looks)
        if number < len(self._times) and passed >= self._times[number] - HOLD_TIME / 4:
            self.looks.append(Observation(state.angles, Quaternion(*state.rotation)))
