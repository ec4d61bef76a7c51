"""Execution of orders: each activity and each stop exactly once."""

from __future__ import annotations

from collections.abc import Callable

from fleet_quadruped.body.machine import BodyStateMachine
from fleet_quadruped.body.measured import BodyMeasurement
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.control.orders import Order
from fleet_quadruped.safety.stages import EMERGENCY_STOP, REQUESTED_TO_LEAVE, BodyMode, StopStage, Trip

_STOP_TRIP = Trip(StopStage.DAMP, EMERGENCY_STOP)
_POWERS = frozenset({BodyRequest.STAND, BodyRequest.RECOVER, BodyRequest.CHECK, BodyRequest.POSE})


class OrderTracker:
    """Executes orders on a body.

    ``answered``, ``halted`` and ``stopped``: number of the last activity, of the last stop of any kind, and
    of the last emergency stop.

    ``refusal``: why the last activity was refused, empty if it was accepted.
    """

    def __init__(self, body: BodyStateMachine, abandoned: float) -> None:
        self.answered = self.halted = self.stopped = 0
        self.refusal = ""
        self._body = body
        self._abandoned = abandoned  # s of silence of the host after which the robot sits down

    def execute_order(
        self, order: Order, now: float, sense: BodyMeasurement, unfit: Callable[[], str]
    ) -> None:
        """Execute the activity, then halt and stop, which so take precedence, then sit down without a host.

        ``unfit`` returns why the drives cannot be enabled now; empty if they can.
        """
        body, activity = self._body, order.activity
        if activity.number > self.answered:
            self.answered = activity.number
            self._release(activity.request)
            refusal = unfit() if self._powers_up(activity.request) else ""
            self.refusal = refusal or body.request(activity.request, activity.value, sense)
        if order.halts > self.halted:
            self.halted = order.halts
            body.halt()
        if order.stop > self.stopped:
            self.stopped = order.stop
            body.trip(_STOP_TRIP)
            if body.mode is BodyMode.OFF:
                body.fault = body.fault or _STOP_TRIP.cause
        silent = now - order.alive
        if order.leave or silent > self._abandoned:
            why = REQUESTED_TO_LEAVE if order.leave else f"no contact with its host for {silent:.0f} s"
            body.trip(Trip(StopStage.SIT, why))

    def _release(self, request: BodyRequest) -> None:
        """Clear the fault of an emergency stop, which the host has released, on a request to get up."""
        if request in {BodyRequest.STAND, BodyRequest.RECOVER} and self._body.fault == EMERGENCY_STOP:
            self._body.fault = ""

    def _powers_up(self, request: BodyRequest) -> bool:
        """Return True if the request enables the drives; a latched fault is refused by the body itself."""
        return request in _POWERS and self._body.mode is BodyMode.OFF and not self._body.fault
