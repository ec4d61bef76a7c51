"""Coordinated start of a step: each robot is prepared, then all begin at one instant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Protocol

from fleet.missions.state import NotStarted, Phase, RobotPrepared, RunEvent, StepPart
from fleet.model.command import Reply, Transport
from fleet.wire.rules import Kind


class Together(Protocol):
    """A coordinated start of several robots; its callbacks run on the event loop."""

    def prepare(
        self,
        robot: str,
        kind: Kind,
        payload: bytes,
        *,
        transport: Transport,
        identity: str,
        heard: Callable[[Reply], None],
    ) -> None:
        """Ask a robot to prepare; ``heard`` receives the result, and later the replies after the start."""

    def begin(self, robots: Sequence[str], failed: Callable[[str], None]) -> None:
        """Let all robots begin at one instant; ``failed`` receives the reason if none begins."""

    def withdraw(self) -> None:
        """Cancel the robots that have not started."""


class TogetherStep:
    """Prepares and begins such steps. ``handle`` receives events, ``replied`` the outcome of an identity."""

    def __init__(
        self,
        new: Callable[[], Together],
        transport: Transport,
        *,
        payload: Callable[[dict[str, Any]], bytes],
        handle: Callable[[RunEvent], None],
        replied: Callable[[str, Reply], None],
    ) -> None:
        self._new = new
        self._transport = transport
        self._payload = payload
        self._handle = handle
        self._replied = replied
        self._start: Together | None = None
        self._step = ""
        self._unconfirmed: dict[str, StepPart] = {}  # parts that were sent their start, not confirmed yet

    def unpausable(self, phase: Phase) -> str:
        """Return why a run must not be paused now; empty if it may.

        Robots about to begin have no motion to pause yet, and might begin all the same.
        """
        if phase is not Phase.PREPARING and not any(part.inflight for part in self._unconfirmed.values()):
            return ""
        return "its robots are about to begin together: pause it once they have, or abort it now"

    def prepare(self, robot: str, kind: Kind, message: dict[str, Any], identity: str) -> None:
        """Ask a robot to prepare a part; the first reply is the result."""
        first = True

        def heard(reply: Reply) -> None:
            nonlocal first
            if first:
                first = False
                self._handle(RobotPrepared(robot, "" if reply.ok else reply.reason or "it refused"))
            else:
                self._unconfirmed.pop(identity, None)
                self._replied(identity, reply)

        step = identity.rsplit("/", 2)[0]
        if self._start is None or self._step != step:
            self._start, self._step = self._new(), step
        payload = self._payload(message)
        self._start.prepare(robot, kind, payload, transport=self._transport, identity=identity, heard=heard)

    def begin(self, step: str, parts: tuple[StepPart, ...]) -> None:
        """Start prepared robots whose parts are recorded, unless one of them has left meanwhile."""
        if self._start is not None and all(part.inflight for part in parts):
            self._unconfirmed = {part.identity: part for part in parts}
            self._start.begin([part.robot for part in parts], partial(self._not_started, step))
            return
        self.withdraw()
        self._handle(NotStarted(step, "a robot left the run meanwhile"))

    def _not_started(self, step: str, why: str) -> None:
        """Handle a failed start: no robot begins."""
        self._unconfirmed.clear()
        self._handle(NotStarted(step, why))

    def follow(self, phase: Phase) -> None:
        """Cancel the robots that have not started when the run leaves the step."""
        if phase not in (Phase.PREPARING, Phase.STEP):
            self.withdraw()

    def withdraw(self) -> None:
        """Cancel the robots that have not started."""
        self._unconfirmed.clear()
        start, self._start = self._start, None
        if start is not None:
            start.withdraw()
