"""Requests to a self-walking machine: repeated until its state shows that they were accepted."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from fleet import CanFrame
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.safety.stages import BodyMode

NAMES: Mapping[BodyRequest, str] = MappingProxyType(
    {
        BodyRequest.STAND: "stand_up",
        BodyRequest.SIT: "sit_down",
        BodyRequest.RECOVER: "recovery_stand",
        BodyRequest.RESET: "reset_faults",
    }
)
TAKEN: Mapping[BodyRequest, frozenset[BodyMode]] = MappingProxyType(
    {
        BodyRequest.STAND: frozenset(
            {BodyMode.ENABLING, BodyMode.RISING, BodyMode.STANDING, BodyMode.WALKING}
        ),
        BodyRequest.SIT: frozenset({BodyMode.SITTING, BodyMode.SETTLING, BodyMode.OFF}),
        BodyRequest.RECOVER: frozenset(
            {BodyMode.ENABLING, BodyMode.RECOVERING, BodyMode.RISING, BodyMode.STANDING, BodyMode.WALKING}
        ),
    }
)
"""Modes that show that a request was accepted; other requests are accepted when there is no error."""

EVERY = 0.1  # s between two repeats
WITHIN = 1.0  # s within which the state must show it
_HEIGHT_REPEATS = 3


class PendingRequest(NamedTuple):
    """One request in progress."""

    number: int
    request: BodyRequest
    frame: CanFrame
    since: float


class RequestTracker:
    """The request in progress. ``answered``: number of the last finished one, ``refusal``: why it failed."""

    def __init__(self) -> None:
        self.answered = 0
        self.refusal = ""
        self._pending: PendingRequest | None = None
        self._next = 0.0

    def begin(
        self, number: int, request: BodyRequest, frame: CanFrame | None, refusal: str, now: float
    ) -> None:
        """Begin a request, or answer it at once: refused, or done if there is no frame to send."""
        self.end("another command came first")
        self._next = now
        self._pending = None
        if refusal or frame is None:
            self.answered, self.refusal = number, refusal
            return
        self._pending = PendingRequest(number, request, frame, now)

    def end(self, refusal: str = "") -> None:
        """Answer the request in progress."""
        if self._pending is not None:
            self.answered, self.refusal, self._pending = self._pending.number, refusal, None

    def step(self, now: float, mode: BodyMode, error: str) -> CanFrame | None:
        """Return the frame to send now, or None; ends a request that was accepted, or has timed out."""
        pending = self._pending
        if pending is None:
            return None
        requested = now > pending.since
        if requested and _is_taken(pending, mode, error, now):
            self.end()
            return None
        if now - pending.since > WITHIN:
            name = NAMES.get(pending.request, pending.request.value)
            self.end(f"{name} was not taken within {WITHIN:g} s: it is {mode.value}{error and f', {error}'}")
            return None
        if now < self._next:
            return None
        self._next = now + EVERY
        return pending.frame


def _is_taken(pending: PendingRequest, mode: BodyMode, error: str, now: float) -> bool:
    """Return True if the state shows it; a height is not reported, so it is sent a few times."""
    if pending.request is BodyRequest.HEIGHT:
        return now - pending.since > _HEIGHT_REPEATS * EVERY
    if pending.request is BodyRequest.RESET:
        return not error
    return mode in TAKEN[pending.request]
