"""One ask's answer: exactly one receipt, and one end for whoever waits for it."""

from __future__ import annotations

import logging
from collections.abc import Callable

from fleet.errors import CommandError, LinkError, TimedOut, Unsupported
from fleet.model.command import Answer, Reply, ReplyStatus

log = logging.getLogger(__name__)

_STATUS: tuple[tuple[type[Exception], ReplyStatus], ...] = (
    (Unsupported, ReplyStatus.REJECTED),
    (TimedOut, ReplyStatus.TIMEOUT),
    (CommandError, ReplyStatus.DENIED),
    (LinkError, ReplyStatus.TIMEOUT),
)
"""What an error means to the asker; the first that fits."""


class Receipt:
    """The answer to one ask; ``waits``: the asker also wants to hear how it ended.

    It is kept for minutes, for repeats of the ask: once it has ended it holds on to nobody.
    """

    __slots__ = ("_answer", "_waits", "_watchers", "command", "ended", "first")

    def __init__(self, command: str, answer: Answer, *, waits: bool = False) -> None:
        self.command = command
        self._answer = answer
        self._waits = waits
        self._watchers: list[Callable[[Reply], None]] = []
        self.first: Reply | None = None
        self.ended: Reply | None = None

    @property
    def reason(self) -> str:
        """Why it failed; empty before it ended, and when it was done."""
        return self.ended.reason if self.ended is not None else ""

    def watch(self, seen: Callable[[Reply], None]) -> None:
        """Also tell ``seen`` the receipt and the end, those that are out already at once."""
        if self.ended is None:
            self._watchers.append(seen)
        if self.first is not None:
            seen(self.first)
        if self.ended is not None and self.ended is not self.first:
            seen(self.ended)

    def accept(self) -> None:
        """Say that the robot took it; saying it again changes nothing."""
        self._receive(Reply(self.command, ReplyStatus.ACCEPTED))

    def follow(self, first: Receipt) -> None:
        """Give the answers that the first of its repeats got, and those that it is still to get."""
        first.watch(lambda reply: self._receive(reply) if reply.done is None else self._end(reply))

    def done(self, data: object = None) -> None:
        """Say that the robot was seen to have done it; ``data`` is what was asked for.

        Where nothing was answered yet this is the one answer: receipt and end.
        """
        self._end(Reply(self.command, ReplyStatus.ACCEPTED, done=True, data=data))

    def do(self, work: Callable[[], object]) -> None:
        """Do it, and say that it was done, with what came of it."""
        self.done(work())

    def reject(self, reason: str, *, hint: str = "") -> None:
        """Say that the host refused it."""
        self._fail(Reply(self.command, ReplyStatus.REJECTED, reason, hint))

    def fail(self, error: CommandError | LinkError) -> None:
        """Say what went wrong in the robot's own words."""
        status = next(status for kind, status in _STATUS if isinstance(error, kind))
        if isinstance(error, CommandError):
            reply = Reply(self.command, status, error.reason, error.hint, error.device_result, error.messages)
        else:
            reply = Reply(self.command, status, str(error))
        self._fail(reply)

    def _fail(self, reply: Reply) -> None:
        """Send a failure as the receipt, or as the end when the receipt is out."""
        self._receive(reply)
        self._end(Reply(**{name: getattr(reply, name) for name in _FIELDS}, done=False))

    def _receive(self, reply: Reply) -> None:
        """Send the receipt, once."""
        if self.first is None:
            self.first = reply
            self._tell(reply)
            self._send(reply)

    def _end(self, reply: Reply) -> None:
        """Send the end, once, to whoever waits; a refused receipt was the end already.

        Where nothing was answered yet, the end is the receipt.
        """
        if self.ended is not None:
            return
        self.ended = reply
        if self.first is None:
            self._receive(reply)
        else:
            self._tell(reply)
            if self._waits and self.first.ok:
                self._send(reply)
        self._answer, self._watchers = _nobody, []

    def _send(self, reply: Reply) -> None:
        """Answer the asker; that he cannot be reached is no fault of the robot's."""
        try:
            self._answer(reply)
        except Exception:
            log.exception("the answer to %s could not be given", self.command)

    def _tell(self, reply: Reply) -> None:
        """Tell the watchers."""
        for seen in self._watchers:
            seen(reply)


def _nobody(_reply: Reply) -> None:
    """Answer nobody: whoever asked has heard the end."""


_FIELDS = tuple(name for name in Reply.__struct_fields__ if name != "done")
