"""The answer to one request: exactly one receipt, and one final result for a sender that waits."""

from __future__ import annotations

import logging
from collections.abc import Callable

from fleet.errors import CommandError, LinkError, TimedOut, Unsupported
from fleet.model.command import Answer, Reply, ReplyStatus
from fleet.runtime.exception_barrier import error_text

log = logging.getLogger(__name__)

_STATUS: tuple[tuple[type[Exception], ReplyStatus], ...] = (
    (Unsupported, ReplyStatus.REJECTED),
    (TimedOut, ReplyStatus.TIMEOUT),
    (CommandError, ReplyStatus.DENIED),
    (LinkError, ReplyStatus.TIMEOUT),
)
"""Reply status of an error; the first class that matches."""


class Receipt:
    """Answer to one request; ``waits``: the sender also wants the final result.

    The dedup cache keeps it for minutes. Once ended, it therefore holds no references to its sender or
    watchers.
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
        """Reason of the failure; empty before the end, and after success."""
        return self.ended.reason if self.ended is not None else ""

    def watch(self, seen: Callable[[Reply], None]) -> None:
        """Pass the receipt and the final result to ``seen`` as well; at once if they are already out."""
        if self.ended is None:
            self._watchers.append(seen)
        if self.first is not None:
            seen(self.first)
        if self.ended is not None and self.ended is not self.first:
            seen(self.ended)

    def accept(self) -> None:
        """Send the receipt: accepted. Later calls have no effect."""
        self._receive(Reply(self.command, ReplyStatus.ACCEPTED))

    def follow(self, first: Receipt) -> None:
        """Repeat the answers of the first request, past and future."""
        first.watch(lambda reply: self._receive(reply) if reply.done is None else self._end(reply))

    def done(self, data: object = None) -> None:
        """End it as done; ``data`` is the result of a query.

        Without an earlier receipt this is the only answer: receipt and end in one.
        """
        self._end(Reply(self.command, ReplyStatus.ACCEPTED, done=True, data=data))

    def do(self, work: Callable[[], object]) -> None:
        """Call ``work`` and end as done, with its result."""
        self.done(work())

    def reject(self, reason: str, *, hint: str = "") -> None:
        """End it as refused by the host."""
        self._fail(Reply(self.command, ReplyStatus.REJECTED, reason, hint))

    def fail(self, error: CommandError | LinkError) -> None:
        """End it with the error, in the robot's own words."""
        status = next(status for kind, status in _STATUS if isinstance(error, kind))
        if isinstance(error, CommandError):
            reason = error.reason or type(error).__name__
            reply = Reply(self.command, status, reason, error.hint, error.device_result, error.messages)
        else:
            reply = Reply(self.command, status, error_text(error))
        self._fail(reply)

    def _fail(self, reply: Reply) -> None:
        """Send a failure as the receipt, or as the end if the receipt is out."""
        self._receive(reply)
        self._end(Reply(**{name: getattr(reply, name) for name in _FIELDS}, done=False))

    def _receive(self, reply: Reply) -> None:
        """Send the receipt, once."""
        if self.first is None:
            self.first = reply
            self._notify(reply)
            self._send(reply)

    def _end(self, reply: Reply) -> None:
        """Send the final result, once, to a sender that waits; a refused receipt was already the end.

        Without an earlier receipt, it is the receipt.
        """
        if self.ended is not None:
            return
        self.ended = reply
        if self.first is None:
            self._receive(reply)
        else:
            self._notify(reply)
            if self._waits and self.first.ok:
                self._send(reply)
        self._answer, self._watchers = _discard, []

    def _send(self, reply: Reply) -> None:
        """Send a reply; an unreachable sender is not an error of the robot."""
        try:
            self._answer(reply)
        except Exception:
            log.exception("the answer to %s could not be given", self.command)

    def _notify(self, reply: Reply) -> None:
        """Call the watchers; the failure of one keeps neither the others nor the answer back."""
        for seen in self._watchers:
            try:
                seen(reply)
            except Exception:
                log.exception("the outcome of %s could not be passed on", self.command)


def _discard(_reply: Reply) -> None:
    """Discard a reply: the sender has received the final one."""


_FIELDS = tuple(name for name in Reply.__struct_fields__ if name != "done")
