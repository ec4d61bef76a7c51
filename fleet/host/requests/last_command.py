"""The last thing that was asked of a robot, and how it went: for people."""

from __future__ import annotations

from fleet.host.requests.receipt import Receipt
from fleet.host.safety.admission import JOIN, LEAVE
from fleet.model.command import Reply

BOOKKEEPING = frozenset({JOIN, LEAVE})
"""Who has the robot: nobody asks for it by hand, and people are not shown it as what the robot did last."""


class LastCommand:
    """Last command and outcome of one robot."""

    def __init__(self) -> None:
        self.command = ""
        self.outcome = ""

    def follow(self, command: str, receipt: Receipt) -> None:
        """Note a command that is under way, and from its receipt how it goes on."""
        if command in BOOKKEEPING:
            return
        self.command, self.outcome = command, "under way"
        receipt.watch(self._heard)

    def accepted(self, command: str) -> None:
        """Note a velocity that is held."""
        self.command, self.outcome = command, "accepted"

    def _heard(self, reply: Reply) -> None:
        self.outcome = reply.outcome
