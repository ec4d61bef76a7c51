"""Commands that change control of a robot: a mission run joins and leaves, a person takes over."""

from __future__ import annotations

from collections.abc import Callable

from fleet.errors import Refused
from fleet.host.requests.receipt import Receipt
from fleet.host.safety.admission import JOIN, LEAVE, TAKE, Admission
from fleet.model.command import Command

Carries = Callable[[Command, Receipt], None]


def control_commands(admission: Admission, stop: Carries) -> dict[str, Carries]:
    """Return the handlers by command; ``stop`` ends the robot's motion."""

    def take(request: Command, receipt: Receipt) -> None:
        if not admission.lease.run:
            receipt.reject("it is in no run")
            return
        admission.leave(request)
        stop(
            Command("stop", origin=request.origin, stamp=request.stamp), receipt
        )  # nothing monitors its motion now

    return {JOIN: _answered(admission.join), LEAVE: _answered(admission.leave), TAKE: take}


def _answered(work: Callable[[Command], None]) -> Carries:
    """Return a handler that calls ``work`` and answers done, or the refusal."""

    def own(request: Command, receipt: Receipt) -> None:
        try:
            work(request)
        except Refused as error:
            receipt.fail(error)
        else:
            receipt.done()

    return own
