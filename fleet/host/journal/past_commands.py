"""Commands of earlier processes, as the journal remembers them."""

from __future__ import annotations

import msgspec

from fleet.host.requests.receipt import Receipt

DONE = "completed"
"""The outcome of a command that the robot was seen to have carried out."""


class PastCommand(msgspec.Struct, frozen=True):
    """A command of an earlier process; ``outcome`` is empty when it was not seen to end."""

    identity: str
    name: str
    action: bool
    outcome: str

    @property
    def verdict(self) -> str:
        """Say why it is not carried out again."""
        how = f"ended {self.outcome}" if self.outcome else "was not seen to end"
        return f"it was begun before the edge restarted and {how}; it is not carried out twice"


class InterruptedCommand(msgspec.Struct, frozen=True):
    """A command whose end no process saw, and whose asker has not been told so; ``way``: how it was asked."""

    robot: str
    identity: str
    name: str
    way: str


def answer_to(past: PastCommand) -> Receipt:
    """Return what answers a repeat of a command of an earlier process."""
    receipt = Receipt(past.name, lambda _reply: None)
    if past.outcome == DONE:
        receipt.done()
    else:
        receipt.reject(past.verdict)
    return receipt
