"""Commands of earlier processes, from the journal."""

from __future__ import annotations

import msgspec

from fleet.host.requests.receipt import Receipt

DONE = "completed"
"""Outcome of a command that the robot was seen to have carried out."""
MOTION = ""
"""Identity of the record of any motion, also of requests without an identity; no request has it."""


class PastCommand(msgspec.Struct, frozen=True):
    """A command of an earlier process; ``outcome`` is empty when its end is unknown."""

    identity: str
    name: str
    action: bool
    outcome: str

    @property
    def moves(self) -> bool:
        """True if the robot may still be moving unless the end is known."""
        return self.action or self.identity == MOTION

    @property
    def verdict(self) -> str:
        """Reason for not executing it again."""
        how = f"ended {self.outcome}" if self.outcome else "was not seen to end"
        return f"it was started before the edge restarted and {how}; it is not executed twice"


class InterruptedCommand(msgspec.Struct, frozen=True):
    """A command without a known end, which is still to be reported; ``transport``: its transport."""

    robot: str
    identity: str
    name: str
    transport: str


def answer_to(past: PastCommand) -> Receipt:
    """Return the receipt that answers a repeat of a command of an earlier process."""
    receipt = Receipt(past.name, lambda _reply: None)
    if past.outcome == DONE:
        receipt.done()
    else:
        receipt.reject(past.verdict)
    return receipt
