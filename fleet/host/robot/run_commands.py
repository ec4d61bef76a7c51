"""Commands that say who has a robot: a run of a mission takes and leaves it, a person takes it back."""

from __future__ import annotations

from collections.abc import Callable

from fleet.errors import Refused
from fleet.host.requests.receipt import Receipt
from fleet.host.safety.admission import JOIN, LEAVE, TAKE, Admission
from fleet.model.command import Command

Carries = Callable[[Command, Receipt], None]


def run_commands(admission: Admission, stop: Carries) -> dict[str, Carries]:
    """Return what carries each of them out, and answers; ``stop`` ends the robot's motion."""

    def take(ask: Command, receipt: Receipt) -> None:
        if not admission.lease.run:
            receipt.reject("it is in no run")
            return
        admission.leave(ask)
        stop(Command("stop", origin=ask.origin, stamp=ask.stamp), receipt)  # nobody follows what it does now

    return {JOIN: _answered(admission.join), LEAVE: _answered(admission.leave), TAKE: take}


def _answered(work: Callable[[Command], None]) -> Carries:
    """Return what does some work and answers that it was done, or why it was refused."""

    def own(ask: Command, receipt: Receipt) -> None:
        try:
            work(ask)
        except Refused as error:
            receipt.fail(error)
        else:
            receipt.done()

    return own
