"""The small moves of ``fleet can check --move``: gives a controller its orders, notes what is seen."""

from __future__ import annotations

from collections.abc import Callable

from fleet import Clock, Quaternion
from fleet_quadruped.body.probing import HOLD_TIME, look_times
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.commissioning import Observation
from fleet_quadruped.control.orders import Activity, DogState, Order
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.safety.stages import Mode

_HEARD = 0.3  # s until every drive and the IMU have been heard
_ASKED = Activity(1, BodyRequest.CHECK)


class Moves:
    """Where orders come from and states go, for the time of a check.

    ``interrupted`` is asked in every cycle whether a person wants it to end: that is an emergency stop.
    ``looks`` is what was seen; ``ended`` says why there are not more, empty when it went to its end.
    """

    def __init__(self, dog: DogDescription, clock: Clock, interrupted: Callable[[], bool]) -> None:
        self.looks: list[Observation] = []
        self.ended = ""
        self._times = look_times(dog)
        self._clock = clock
        self._interrupted = interrupted
        self._begun = clock.monotonic()
        self._moving: float | None = None  # since when
        self._stop = 0
        self._leave = False

    def order(self) -> Order:
        """Return the newest order."""
        now = self._clock.monotonic()
        if self._interrupted():
            self._stop = 1
        activity = _ASKED if now - self._begun > _HEARD else Activity()
        return Order(alive=now, activity=activity, stop=self._stop, leave=self._leave)

    def put(self, state: DogState) -> None:
        """Note what is seen whenever the trunk has come to rest, and whether it is over."""
        if state.mode == Mode.CHECKING:
            self._moving = state.stamp if self._moving is None else self._moving
            self._look(state, state.stamp - self._moving)
        elif state.answered and state.mode == Mode.OFF:
            self.ended = self.ended or state.refusal or state.fault
            self._leave = True

    def _look(self, state: DogState, passed: float) -> None:
        """Look once towards the end of each pause."""
        number = len(self.looks)
        if number < len(self._times) and passed >= self._times[number] - HOLD_TIME / 4:
            self.looks.append(Observation(state.angles, Quaternion(*state.rotation)))
