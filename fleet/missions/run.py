"""One run in progress: the engine with its robots, store and clock. Runs on the event loop.

The consequences of an event are recorded first; only then are robots commanded, in the same order.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, Protocol

from fleet.clock import Clock
from fleet.errors import Refused
from fleet.missions.engine import Engine
from fleet.missions.holding import RequestedHolds
from fleet.missions.messages import message_of, payload_of
from fleet.missions.observed import RunMembership, facts_of, outcome_of
from fleet.missions.points import SiteMap
from fleet.missions.program import Act
from fleet.missions.state import (
    Begin,
    BeginTogether,
    Dismiss,
    EmergencyStop,
    Ended,
    Enlist,
    Enlisted,
    Hold,
    Left,
    LogNote,
    Occupy,
    PartOutcome,
    Prepare,
    Replied,
    RobotPrepared,
    RunEffect,
    RunEvent,
    RunOutcome,
    Tick,
)
from fleet.missions.store import RunChange, RunOrigin, RunStore
from fleet.missions.together import Together, TogetherStep
from fleet.model.command import Reply, Request, Transport, session_of
from fleet.model.state import RobotState
from fleet.wire.rules import Kind

log = logging.getLogger(__name__)

JOIN, LEAVE = "join_run", "leave_run"


class RunPort(Protocol):
    """A robot of the edge, as a run needs it."""

    name: str

    def state(self) -> RobotState:
        """Return its present state."""

    def read(
        self, kind: Kind, payload: bytes, *, transport: Transport, request_id: str = "", waits: bool = False
    ) -> Request | None:
        """Decode a message; the result starts its execution."""


class RunServices(Protocol):
    """Resources shared by all runs of an edge."""

    clock: Clock
    store: RunStore
    site: SiteMap
    robots: Mapping[str, RunPort]

    def soon(self, call: Callable[[], None]) -> None:
        """Run a call on the event loop; from any thread."""

    def stop(self, robots: tuple[str, ...], why: str) -> None:
        """Set the emergency stop of robots."""

    def together(self) -> Together:
        """Return a new coordinated start of several robots."""

    def changed(self, run: Run) -> None:
        """Handle a change of a run's state."""

    def occupy(self, run: Run) -> None:
        """Occupy the places of a run or queue it for them; the run receives the result as an event."""

    def release_places(self, run: Run) -> None:
        """Release the places of a run."""


class Run:
    """One run. ``elapsed``: seconds of its own clock so far, including earlier processes.

    ``stamp``: the time of the request by the sender's clock (Unix s); None if unknown, and for a resumed run.
    """

    def __init__(
        self,
        about: RunOrigin,
        engine: Engine,
        services: RunServices,
        *,
        elapsed: float = 0.0,
        stamp: float | None = None,
    ) -> None:
        self.about = about
        self._stamp = stamp
        self.engine = engine
        self._services = services
        self._elapsed = elapsed
        self._since = services.clock.monotonic()
        self._session = session_of(about.run)
        self._head = b""
        self._sent: set[str] = set()
        self._membership = RunMembership(about.run, services.clock)
        self.holding = RequestedHolds(self.handle, services.clock)
        self.together = TogetherStep(
            services.together,
            Transport(about.transport),
            payload=self._payload,
            handle=self.handle,
            replied=self._replied,
        )

    @property
    def id(self) -> str:
        """The run's id."""
        return self.about.run

    @property
    def now(self) -> float:
        """Seconds of the run's clock."""
        return self._elapsed + self._services.clock.monotonic() - self._since

    def handle(self, event: RunEvent, *, new: bool = False) -> None:
        """Handle an event: record its changes, then execute its effects."""
        effects = self.engine.handle(event, self.now)
        self.together.follow(self.engine.head.phase)
        if holds := [effect for effect in effects if isinstance(effect, Hold)]:
            self.holding.expect(holds)
        touched = self.engine.changes()
        head = repr(self.engine.head).encode()
        if not (new or touched or effects or head != self._head):
            return
        self._head = head
        services = self._services
        notes = [effect for effect in effects if isinstance(effect, LogNote)]
        change = RunChange(
            self.id,
            self.engine.head,
            [*self.engine.robots.members.values(), *touched] if new else touched,
            notes,
            services.clock.time(),
            self.now,
            self.about if new else None,
            self.engine.program if new else None,
        )
        follow = partial(self._recorded, effects, new)
        services.store.save(change, lambda kept: services.soon(partial(follow, kept)))
        services.changed(self)

    def poll(self) -> None:
        """Poll the robots, and let time pass."""
        for member in self.engine.robots.ours():
            self._check_robot(member.robot)
        self.observe([member.robot for member in self.engine.robots.spares("all")])
        self.holding.expire()
        self.handle(Tick())

    def observe(self, robots: Iterable[str]) -> None:
        """Pass the facts of robots to the engine; robots that were removed from fleet.yaml are skipped."""
        for robot in robots:
            if robot in self._services.robots:
                self.handle(facts_of(self._services.robots[robot].state()))

    def _check_robot(self, robot: str) -> None:
        """Pass the facts of a robot to the engine, and whether it has left the run."""
        state = self._services.robots[robot].state()
        self.handle(facts_of(state))
        left = self._membership.leave_reason(state)
        if left is not None:
            self.handle(Left(robot, *left))

    # -- effects ---------------------------------------------------------------------------------------

    def _recorded(self, effects: list[RunEffect], new: bool, kept: bool) -> None:  # noqa: FBT001 - by position
        """Execute effects after the record; a run whose start could not be recorded begins nothing."""
        if kept or not new:
            self._carry_out(effects)
            return
        self.engine.ending.close(RunOutcome.FAILED, f"it was not started: {self._services.store.problem}")
        self.handle(Tick())  # reports the end and releases the robots

    def _carry_out(self, effects: list[RunEffect]) -> None:
        """Execute the effects of a recorded event; on an unexpected error give the run up."""
        try:
            for effect in effects:
                self._follow(effect)
        except Exception as error:
            log.exception("run %s cannot go on", self.id)
            self.give_up(f"{type(error).__name__}: {error}")

    def give_up(self, reason: str) -> None:
        """End a run after an unexpected error: its robots stop, its outcome is unknown."""
        if self.engine.over:
            return
        for member in self.engine.robots.ours():
            if not self.engine.robots.comes_down(member.robot):
                with contextlib.suppress(Exception):  # one robot's failure must not keep another moving
                    self._request(member.robot, "command", {"command": "stop"}, "")
        self.engine.ending.close(RunOutcome.UNKNOWN, f"the edge failed: {reason}")
        self.handle(Tick())  # records the end and releases the robots

    def _follow(self, effect: RunEffect) -> None:
        """Execute one effect."""
        match effect:
            case Begin(part):
                self._command(part.robot, part.act, part.identity)
            case Prepare(robot, act, identity):
                self._command(robot, act, identity, prepares=True)
            case BeginTogether(step, parts):
                self.together.begin(step, parts)
            case Hold(part, resumes):
                message = {"command": "resume" if resumes else "pause"}
                self._request(part.robot, "navigate", message, "", partial(self.holding.answered, effect))
            case EmergencyStop(robots, reason):
                self._services.stop(robots, f"run {self.id}: {reason}")
            case Enlist(robot):
                self._enlist(robot)
            case Dismiss(robot):
                self.leave(robot)
            case Occupy():
                self._services.occupy(self)
            case Ended():
                self.holding.end()
                self._give_back()
                self._services.release_places(self)
            case _:
                pass

    def _command(self, robot: str, act: Act, identity: str, *, prepares: bool = False) -> None:
        """Command or prepare a robot, at most once, unless its part has ended or it has left the run."""
        part = self.engine.robots.parts.get(identity)
        if (identity in self._sent or part is None or not part.inflight) and not prepares:
            return
        self._sent.add(identity)
        state = self._services.robots[robot].state()
        left = self._membership.leave_reason(state)
        if left is not None:
            self.handle(Left(robot, *left))
            return
        try:
            kind, message = message_of(act, identity, state, self._services.site)
        except Refused as error:
            refusal = Replied(identity, PartOutcome.REFUSED, error.reason)
            self.handle(RobotPrepared(robot, error.reason) if prepares else refusal)
            return
        if prepares:
            self.together.prepare(robot, kind, message, identity)
        else:
            self._request(robot, kind, message, identity, partial(self._replied, identity))

    def _request(
        self,
        robot: str,
        kind: Kind,
        message: dict[str, Any],
        identity: str,
        answer: Callable[[Reply], None] = lambda _: None,
    ) -> None:
        """Send a robot a message in the name of the user who started the run."""
        self._send(robot, kind, self._payload(message), answer, identity)

    def _send(
        self, robot: str, kind: Kind, payload: bytes, answer: Callable[[Reply], None], identity: str = ""
    ) -> None:
        """Send a robot a message over the transport by which the run was started."""
        transport = Transport(self.about.transport)
        requested = self._services.robots[robot].read(
            kind, payload, transport=transport, request_id=identity, waits=True
        )
        if requested is not None:
            requested(answer)

    def _payload(self, message: dict[str, Any]) -> bytes:
        """Encode a message sent now."""
        now = self._services.clock.time()
        return payload_of(message, session=self._session, source_type=self.about.source_type, now=now)

    def _replied(self, identity: str, reply: Reply) -> None:
        """Handle a robot's answer, after its departure if it has left the run."""
        outcome, part = outcome_of(reply), self.engine.robots.parts.get(identity)
        if outcome is None or part is None:
            return
        if outcome is not PartOutcome.DONE and part.inflight:
            self._check_robot(part.robot)
        self.handle(Replied(part.identity, outcome, reply.reason))

    def join(self, robot: str, answer: Callable[[Reply], None]) -> None:
        """Request a robot; until it is released it obeys no other sender's motion.

        The request carries the sender and stamp of the start, so that the robot itself refuses a start that
        is too late or was requested before a stop.
        """

        def answered(reply: Reply) -> None:
            if reply.done:
                self._membership.joined(robot)
            answer(reply)

        message = {"command": JOIN, "data": {"run": self.id}}
        if self._stamp is None:
            self._request(robot, "command", message, "", answered)
            return
        session, source_type = self.about.by, self.about.source_type
        payload = payload_of(message, session=session, source_type=source_type, now=self._stamp)
        self._send(robot, "command", payload, answered)

    def _enlist(self, robot: str) -> None:
        """Request a spare; one that was removed from fleet.yaml is not asked."""
        if robot not in self._services.robots:
            self.handle(Enlisted(robot, "it was removed from fleet.yaml"))
            return

        def answered(reply: Reply) -> None:
            if reply.ok and not reply.done:
                return
            if reply.ok and self.engine.over:  # it has joined a run that has ended meanwhile
                self.leave(robot)
            self.handle(Enlisted(robot, "" if reply.ok else reply.reason or "it refused"))

        self.join(robot, answered)

    def _give_back(self) -> None:
        """Release all robots except unused spares."""
        for member in self.engine.robots.members.values():
            if member.robot in self._services.robots and not member.spare:
                self.leave(member.robot)

    def leave(self, robot: str) -> None:
        """Release a robot."""
        self._request(robot, "command", {"command": LEAVE, "data": {"run": self.id}}, "")
