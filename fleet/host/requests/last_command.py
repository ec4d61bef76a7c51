"""Last command of a robot and its outcome, for people."""

from __future__ import annotations

from functools import partial

from fleet.host.requests.receipt import Receipt
from fleet.host.safety.admission import JOIN, LEAVE
from fleet.model.command import Reply

BOOKKEEPING = frozenset({JOIN, LEAVE})
"""Commands of mission runs that only take and return control; not shown as the robot's last command."""


class LastCommand:
    """Last command and outcome of one robot; an earlier command may end later, which changes neither."""

    def __init__(self) -> None:
        self.command = ""
        self.outcome = ""
        self._receipt: Receipt | None = None

    def follow(self, command: str, receipt: Receipt) -> None:
        """Record a command as running, and follow its receipt."""
        if command in BOOKKEEPING:
            return
        self.command, self.outcome, self._receipt = command, "under way", receipt
        receipt.watch(partial(self._on_reply, receipt))

    def accepted(self, command: str) -> None:
        """Record an accepted velocity."""
        self.command, self.outcome, self._receipt = command, "accepted", None

    def _on_reply(self, receipt: Receipt, reply: Reply) -> None:
        if receipt is self._receipt:
            self.outcome = reply.outcome
