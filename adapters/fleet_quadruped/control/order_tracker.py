"""Orders, each activity and each stop of which is carried out once."""

from __future__ import annotations

from collections.abc import Callable

from fleet_quadruped.body.machine import BodyStateMachine
from fleet_quadruped.body.measured import Sense
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.control.orders import Order
from fleet_quadruped.safety.stages import EMERGENCY_STOP, TOLD_TO_LEAVE, Mode, Stage, Trip

_STOP_TRIP = Trip(Stage.DAMP, EMERGENCY_STOP)
_POWERS = frozenset({BodyRequest.STAND, BodyRequest.RECOVER, BodyRequest.CHECK, BodyRequest.POSE})


class OrderTracker:
    """Carries orders out on a body. ``answered`` and ``stopped``: number of the last activity, and stop.

    ``refusal``: why the last activity was refused, empty when it was taken.
    """

    def __init__(self, body: BodyStateMachine, abandoned: float) -> None:
        self.answered = self.stopped = 0
        self.refusal = ""
        self._body = body
        self._abandoned = abandoned  # s of silence of the host after which the dog sits down
        self._halts = 0

    def obey(self, order: Order, now: float, sense: Sense, unfit: Callable[[], str]) -> None:
        """Take what is asked, then stops, which so have the last word, then the absence of whoever asks.

        ``unfit`` returns why the drives cannot be powered now; empty when they can.
        """
        body, activity = self._body, order.activity
        if activity.number > self.answered:
            self.answered = activity.number
            self._release(activity.ask)
            refusal = unfit() if self._powers_up(activity.ask) else ""
            self.refusal = refusal or body.ask(activity.ask, activity.value, sense)
        if order.halts > self._halts:
            self._halts = order.halts
            body.halt()
        if order.stop > self.stopped:
            self.stopped = order.stop
            body.trip(_STOP_TRIP)
            if body.mode is Mode.OFF:
                body.fault = body.fault or _STOP_TRIP.cause
        silent = now - order.alive
        if order.leave or silent > self._abandoned:
            why = TOLD_TO_LEAVE if order.leave else f"nothing heard from its host for {silent:.0f} s"
            body.trip(Trip(Stage.SIT, why))

    def _release(self, ask: BodyRequest) -> None:
        """End an emergency stop, which the host has released, by a new command to get up; no other fault."""
        if ask in {BodyRequest.STAND, BodyRequest.RECOVER} and self._body.fault == EMERGENCY_STOP:
            self._body.fault = ""

    def _powers_up(self, ask: BodyRequest) -> bool:
        """Return True for what needs the drives; with a fault the body has its own words for a refusal."""
        return ask in _POWERS and self._body.mode is Mode.OFF and not self._body.fault
