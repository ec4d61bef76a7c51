"""Pauses and resumptions of one run: what its robots answer, told to the asker once all have."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fleet.clock import Clock
from fleet.missions.state import Hold, Pause
from fleet.model.command import Reply

ANSWERED_WITHIN = 8.0  # s; a pause is answered once the robot holds

Told = Callable[[str], None]
"""Hears why something was refused; nothing when it was not."""


class _Request:
    """One pause or resumption. ``open``: the identities of the parts whose robots have not answered."""

    def __init__(self, holds: Sequence[Hold], until: float) -> None:
        self.resumes = holds[0].resumes
        self.open = {hold.part.identity: hold for hold in holds}
        self.until = until
        self.refusals: list[str] = []
        self.told: list[Told] = []


class Holding:
    """What the robots of one run answer; ``take`` takes it to the run that one of them does not do it."""

    def __init__(self, take: Callable[[Pause], None], clock: Clock) -> None:
        self._take = take
        self._clock = clock
        self._requests: list[_Request] = []
        self.made = 0  # requests so far

    def expect(self, holds: Sequence[Hold]) -> None:
        """Expect the answers of robots that are asked together."""
        self.made += 1
        self._requests.append(_Request(holds, self._clock.monotonic() + ANSWERED_WITHIN))

    def hear(self, made: int, told: Told) -> None:
        """Tell the outcome of the request after the first ``made``; at once when there is none."""
        if self.made == made or not self._requests:
            told("")
        else:
            self._requests[-1].told.append(told)

    def answered(self, hold: Hold, reply: Reply) -> None:
        """Take a robot's answer; the receipt of a pause is followed by its outcome."""
        if reply.ok and reply.done is None and not hold.resumes:
            return
        identity = hold.part.identity
        for request in self._requests:
            if request.resumes == hold.resumes and request.open.pop(identity, None) is not None:
                if not reply.ok or reply.done is False:
                    self._note(request, hold, reply.reason or "it refused")
                self._close(request)
                return

    def turn(self) -> None:
        """Give up robots that do not answer."""
        now = self._clock.monotonic()
        for request in [each for each in self._requests if now >= each.until]:
            late, request.open = list(request.open.values()), {}
            for hold in late:
                self._note(request, hold, f"no answer for {ANSWERED_WITHIN:g} s")
            self._close(request)

    def end(self) -> None:
        """Tell everybody who waits that the run has ended."""
        requests, self._requests = self._requests, []
        for request in requests:
            for told in request.told:
                told("the run has ended")

    def _note(self, request: _Request, hold: Hold, reason: str) -> None:
        """Note a refusal, unless the part has ended meanwhile: then there was nothing to do."""
        if hold.part.inflight:
            robot, what = hold.part.robot, "did not go on" if hold.resumes else "did not pause"
            request.refusals.append(f"{robot}: {reason}")
            self._take(Pause(robot=robot, reason=f"{what}: {reason}"))

    def _close(self, request: _Request) -> None:
        """Tell the outcome once all have answered."""
        if not request.open and request in self._requests:
            self._requests.remove(request)
            for told in request.told:
                told("; ".join(request.refusals))
