"""Pauses and resumptions of one run: collects the answers of its robots for the sender."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fleet.clock import Clock
from fleet.missions.state import Hold, Pause
from fleet.model.command import Reply

ANSWERED_WITHIN = 8.0  # s; a robot answers a pause when it holds

RefusalCallback = Callable[[str], None]
"""Receives the reason of a refusal, or an empty text."""


class _HoldRequest:
    """One pause or resumption. ``open``: the holds without an answer, by the identity of their part."""

    def __init__(self, holds: Sequence[Hold], until: float) -> None:
        self.resumes = holds[0].resumes
        self.open = {hold.part.identity: hold for hold in holds}
        self.until = until
        self.refusals: list[str] = []
        self.callbacks: list[RefusalCallback] = []


class RequestedHolds:
    """Tracks the answers of the robots of one run; ``handle`` reports a robot that refuses to the run."""

    def __init__(self, handle: Callable[[Pause], None], clock: Clock) -> None:
        self._handle = handle
        self._clock = clock
        self._requests: list[_HoldRequest] = []
        self.made = 0  # number of requests so far

    def expect(self, holds: Sequence[Hold]) -> None:
        """Expect the answers of robots that are asked together."""
        self.made += 1
        self._requests.append(_HoldRequest(holds, self._clock.monotonic() + ANSWERED_WITHIN))

    def report_outcome(self, made: int, callback: RefusalCallback) -> None:
        """Report the outcome of the newest request, or at once if there is none after the first ``made``."""
        if self.made == made or not self._requests:
            callback("")
        else:
            self._requests[-1].callbacks.append(callback)

    def answered(self, hold: Hold, reply: Reply) -> None:
        """Handle a robot's answer; the receipt of a pause is ignored, because its outcome follows."""
        if reply.ok and reply.done is None and not hold.resumes:
            return
        identity = hold.part.identity
        for request in self._requests:
            if request.resumes == hold.resumes and request.open.pop(identity, None) is not None:
                if not reply.ok or reply.done is False:
                    self._note(request, hold, reply.reason or "it refused")
                self._close(request)
                return

    def expire(self) -> None:
        """Give up on robots that have not answered in time."""
        now = self._clock.monotonic()
        for request in [each for each in self._requests if now >= each.until]:
            late, request.open = list(request.open.values()), {}
            for hold in late:
                self._note(request, hold, f"no answer for {ANSWERED_WITHIN:g} s")
            self._close(request)

    def end(self) -> None:
        """Report the end of the run to all waiting senders."""
        requests, self._requests = self._requests, []
        for request in requests:
            for callback in request.callbacks:
                callback("the run has ended")

    def _note(self, request: _HoldRequest, hold: Hold, reason: str) -> None:
        """Record a refusal, unless the part has ended meanwhile: then there was nothing to pause."""
        if hold.part.inflight:
            robot, what = hold.part.robot, "did not go on" if hold.resumes else "did not pause"
            request.refusals.append(f"{robot}: {reason}")
            self._handle(Pause(robot=robot, reason=f"{what}: {reason}"))

    def _close(self, request: _HoldRequest) -> None:
        """Report the outcome when all have answered."""
        if not request.open and request in self._requests:
            self._requests.remove(request)
            for callback in request.callbacks:
                callback("; ".join(request.refusals))
