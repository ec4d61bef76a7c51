"""Last command of a robot and its outcome, for people."""

from __future__ import annotations

from fleet.host.requests.receipt import Receipt
from fleet.host.safety.admission import JOIN, LEAVE
from fleet.model.command import Reply

BOOKKEEPING = frozenset({JOIN, LEAVE})
"""Commands of mission runs that only take and return control; not shown as the robot's last command."""


class LastCommand:
    """Last command and outcome of one robot."""

    def __init__(self) -> None:
        self.command = ""
        self.outcome = ""

    def follow(self, command: str, receipt: Receipt) -> None:
        """Record a command as running, and follow its receipt."""
        if command in BOOKKEEPING:
            return
        self.command, self.outcome = command, "under way"
        receipt.watch(self._on_reply)

    def accepted(self, command: str) -> None:
        """Record an accepted velocity."""
        self.command, self.outcome = command, "accepted"

    def _on_reply(self, reply: Reply) -> None:
        self.outcome = reply.outcome
