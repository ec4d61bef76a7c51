"""The runs of one edge: started, followed, controlled, and resumed after a restart.

A start is checked in this order, and refused at the first failure before anything moves: the mission and its
inputs, the roles, the sender's authority for every robot and step, the disk, the robots themselves. Then the
run is recorded, and only then it begins.
"""

from __future__ import annotations

import hashlib
import logging
import re
import secrets
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import msgspec

from fleet.clock import Clock
from fleet.config.missions import Mission
from fleet.errors import Refused
from fleet.missions.engine import Engine
from fleet.missions.filling import Filling, members_of, needs_of
from fleet.missions.holding import RefusalCallback
from fleet.missions.other_edges import EdgeOf, not_kept_apart, require_reach
from fleet.missions.pausing import PAUSABLE
from fleet.missions.points import SiteMap
from fleet.missions.program import Act, Do, Program
from fleet.missions.report import MissionStartRequest, RunControlRequest, RunState, state_of
from fleet.missions.roles import RoleCandidate, spare_of
from fleet.missions.run import Run, RunPort
from fleet.missions.run_places import RunPlaces
from fleet.missions.state import (
    Abort,
    Left,
    PartOutcome,
    Pause,
    PersonAnswer,
    Restarted,
    Resume,
    RobotEvent,
    RunEvent,
    Start,
    StopAll,
)
from fleet.missions.store import RunOrigin, RunStore, StoredRun
from fleet.missions.together import Together
from fleet.model.command import Origin, Reply, Transport

log = logging.getLogger(__name__)

JOIN_WITHIN = 5.0  # s for all robots of a run to join it
BACK_WITHIN = 20.0  # s for robots to answer again after a restart of the edge
MOST = 64  # runs in progress
ENDED = 256  # run IDs kept after the end, for robots whose state still names them
_RUN_ID = re.compile(r"[A-Za-z0-9-]{1,40}")

_CONTROLS: Mapping[str, Callable[[str], RunEvent]] = {"pause": Pause, "resume": Resume, "abort": Abort}
Allowed = Callable[[str, Origin, bool, bool], str | None]
"""Returns why a sender may not start a mission that commands or leads a robot; None if he may."""
Began = Callable[[str, Mapping[str, Sequence[str]], str], None]
"""Called with the run's id and its robots by role, or with an empty id and the reason of a refusal."""


class Runs:
    """Every run of an edge. ``candidates`` returns the present capabilities and facts of the robots.

    ``blocker`` returns why a robot must never execute an act, else empty. ``edge_of`` returns the other
    edge that has a robot, empty for a robot of this edge.
    """

    def __init__(
        self,
        edge: str,
        robots: Mapping[str, RunPort],
        *,
        candidates: Callable[[], list[RoleCandidate]],
        allowed: Allowed,
        blocker: Callable[[str, Act], str],
        edge_of: EdgeOf,
        site: SiteMap,
        store: RunStore,
        clock: Clock,
        soon: Callable[[Callable[[], None]], None],
        stop: Callable[[tuple[str, ...], str], None],
        together: Callable[[], Together],
        on_change: Callable[[RunState], None],
    ) -> None:
        self.edge = edge
        self.robots = robots
        self.site = site  # replaced, with its places, while no run is in progress
        self.store = store
        self.clock = clock
        self.soon = soon
        self.stop = stop
        self.together = together
        self._allowed = allowed
        self._blocker, self._edge_of = blocker, edge_of
        self._on_change = on_change
        self._runs: dict[str, Run] = {}
        self.places = RunPlaces(site.places, self._runs.get, clock)
        self.occupy = self.places.occupy
        self.release_places = self.places.release_places
        self._ended: deque[str] = deque(maxlen=ENDED)
        self.filling = Filling(candidates, self.all, self.places.is_full, self._ended)
        self._pending: dict[str, _Pending] = {}

    # -- services for the runs -------------------------------------------------------------------------

    def changed(self, run: Run) -> None:
        """Publish a run's state; drop a run that has ended."""
        self._on_change(self.state(run))
        if run.engine.over:
            self._runs.pop(run.id, None)
            self._ended.append(run.id)

    def state(self, run: Run) -> RunState:
        """Return the present state of a run."""
        return state_of(run.engine, run.about, self.edge, run.now, self.store.problem)

    @property
    def any(self) -> bool:
        """True while a run is in progress; from any thread."""
        return bool(self._runs)

    def all(self) -> list[Run]:
        """Return the runs in progress, and those whose robots are joining."""
        return [*self._runs.values(), *(pending.run for pending in self._pending.values())]

    def states(self) -> list[RunState]:
        """Return the states of the runs in progress."""
        return [self.state(run) for run in self._runs.values()]

    # -- start -----------------------------------------------------------------------------------------

    def find(self, run: str) -> Run | None:
        """Return a run in progress."""
        return self._runs.get(run)

    def start(
        self,
        mission: Mission,
        program: Program,
        request: MissionStartRequest,
        transport: Transport,
        began: Began,
        *,
        workflow: str = "",
        admitted: bool = False,
    ) -> None:
        """Start a mission; ``began`` is called on the loop with the run, or with the reason of a refusal.

        ``workflow`` is the requesting workflow of the cloud. ``admitted``: the caller has checked the
        sender's authority for every robot and step.
        """
        run = request.run or secrets.token_hex(4)
        if run in self._runs or run in self._pending:
            began(run, {}, "")  # a repeat is the same run
            return
        full = f"{MOST} runs are under way" if len(self._runs) >= MOST else ""
        if self.store.problem or full:
            began("", {}, self.store.problem or full)
            return
        try:
            self.places.require(program)
            roles = self.filling.fill(mission, program, request)
            if not admitted:
                self._require_authority(
                    program, roles, Origin(transport, request.source_type, request.session_id)
                )
            engine = Engine(run, program, members_of(program, roles))
            self._require_routes(engine)
            require_reach(program, engine.robots, self.edge, self._edge_of)
        except Refused as error:
            began("", {}, str(error))
            return
        about = RunOrigin(
            run,
            program.mission,
            digest_of(program, roles),
            self.clock.time(),
            request.session_id,
            transport.value,
            request.source_type,
            dict(request.inputs),
            workflow,
        )
        made = Run(about, engine, self, stamp=request.timestamp)
        self._join(made, partial(self._joined, made, roles, began))

    def _require_authority(
        self, program: Program, roles: Mapping[str, Sequence[str]], origin: Origin
    ) -> None:
        """Raise Refused unless the sender may command every robot and step: a mission grants no rights."""
        needs = needs_of(program)
        for role, robots in roles.items():
            need = needs.get(role.removeprefix(spare_of("")), frozenset())
            leads = bool(need & PAUSABLE)
            for robot in robots:
                refusal = self._allowed(robot, origin, True, leads)
                if refusal:
                    raise Refused(f"{robot}: {refusal}")

    def _require_routes(self, engine: Engine) -> None:
        """Raise Refused for a step that leads a robot where it must not go, before anything moves."""
        robots = engine.robots
        for step in engine.program.steps:
            acts = step.acts if isinstance(step, Do) else {}
            for member in robots.members.values():
                act = robots.act_of(member, acts)
                trouble = self._blocker(member.robot, act) if act is not None else ""
                if trouble:
                    raise Refused(f"{member.robot}: step {step.id}: {trouble}")

    def _join(self, run: Run, done: Callable[[dict[str, str]], None]) -> None:
        """Let every robot of a run join it; ``done`` receives the reasons of those that did not."""
        waiting = {member.robot for member in run.engine.robots.ours()}
        refused: dict[str, str] = {}

        def answered(robot: str, reply: Reply) -> None:
            if reply.ok and not reply.done:
                return
            waiting.discard(robot)
            if not reply.ok:
                refused[robot] = reply.reason

        def then() -> None:
            done(refused | dict.fromkeys(waiting, f"it did not join within {JOIN_WITHIN:g} s"))

        for robot in sorted(waiting):
            run.join(robot, partial(answered, robot))
        until = self.clock.monotonic() + JOIN_WITHIN
        self._pending[run.id] = _Pending(run, lambda: not waiting, until, then)
        self._look_at(run.id)

    def _look_at(self, run: str) -> None:
        """Complete a pending wait that is over or late."""
        pending = self._pending[run]
        if pending.over() or self.clock.monotonic() >= pending.until:
            del self._pending[run]
            pending.then()

    def _joined(
        self, run: Run, roles: Mapping[str, Sequence[str]], began: Began, refused: Mapping[str, str]
    ) -> None:
        """Begin a run whose robots have joined it; if any refused, release the others."""
        refusal = "; ".join(f"{robot}: {why}" for robot, why in refused.items())
        if refusal:
            for member in run.engine.robots.ours():
                if member.robot not in refused:
                    run.leave(member.robot)
            self._ended.append(run.id)
            began("", roles, refusal)
            return
        self._runs[run.id] = run
        run.observe(list(run.engine.robots.members))
        states = (self.robots[name].state() for name in run.engine.robots.members)
        danger = not_kept_apart(states, self._edge_of)
        if danger:
            run.engine.robots.note(danger)
        run.handle(Start(), new=True)
        began(run.id, roles, "")

    # -- progress and control --------------------------------------------------------------------------

    def poll(self) -> None:
        """Poll all runs; called periodically on the loop."""
        for run in list(self._pending):
            self._look_at(run)
        self.places.expire()
        for each in list(self._runs.values()):
            try:
                each.poll()
            except Exception as error:
                log.exception("run %s cannot go on", each.id)
                each.give_up(f"{type(error).__name__}: {error}")

    def control(
        self, run: str, request: RunControlRequest, on_answer: RefusalCallback = lambda _refusal: None
    ) -> None:
        """Pause, resume or abort a run, or answer its question.

        ``on_answer`` receives the reason of a refusal, or an empty text; for a pause or a resumption, after
        its robots have answered.
        """
        found = self._runs.get(run)
        made = found.holding.made if found else 0
        refusal = _control(found, request) if found else f"there is no run {run!r} under way"
        if refusal or found is None:
            on_answer(refusal)
        else:
            found.holding.report_outcome(made, on_answer)

    def stopped(self, names: tuple[str, ...], reason: str) -> None:
        """Handle an emergency stop of several robots, or (without names) of all; on the loop."""
        plain = {name.strip().casefold().rpartition("/")[2] for name in names}
        if len(plain) == 1:  # one robot: its run detects the stop from its state, and may continue without it
            return
        for run in list(self._runs.values()):
            robots = tuple(robot for robot in run.engine.robots.members if not plain or robot in plain)
            if robots:
                run.handle(StopAll(robots, reason))

    def handle_event(self, robot: str, event: str) -> None:
        """Handle an event of a robot; on the loop."""
        for run in list(self._runs.values()):
            if robot in run.engine.robots.members:
                run.handle(RobotEvent(robot, event))

    # -- after a restart -------------------------------------------------------------------------------

    def restore_runs(self) -> None:
        """Resume the runs that an earlier process did not end; their robots may still be connecting."""
        found = self.store.unfinished()
        self.places.restore_runs(found)
        for kept in found:
            self._restore_run(kept, self.clock.monotonic() + BACK_WITHIN)

    def _restore_run(self, kept: StoredRun, until: float) -> None:
        """Resume one run when its robots answer, at the latest at ``until``."""
        away = max(0.0, self.clock.time() - kept.stamp)
        engine = Engine(kept.about.run, kept.program, kept.members, head=kept.head, parts=kept.parts)
        run = Run(kept.about, engine, self, elapsed=kept.elapsed + away)
        for member in engine.robots.ours():
            if member.robot not in self.robots:
                engine.robots.lose(member.robot, PartOutcome.LOST, "it was removed from fleet.yaml", run.now)
        log.warning("run %s of %s was in progress when the edge ended", run.id, kept.about.mission)

        def back() -> bool:
            ours = (self.robots[member.robot] for member in engine.robots.ours())
            return all(robot.state().reachable for robot in ours)

        self._pending[run.id] = _Pending(run, back, until, lambda: self._join(run, partial(self._back, run)))

    def _back(self, run: Run, refused: Mapping[str, str]) -> None:
        """Continue a run of an earlier process without the robots that did not rejoin."""
        self._runs[run.id] = run
        run.observe(list(run.engine.robots.members))
        for robot, why in refused.items():
            run.handle(Left(robot, PartOutcome.LOST, why))
        run.handle(Restarted())


def _control(found: Run, request: RunControlRequest) -> str:
    """Pass a control event to a run; return why the run did not accept it."""
    if request.do == "answer":
        question = found.engine.head.question
        if question is None or (request.question and question.id != request.question):
            return "it asks nothing" if question is None else "it asks something else by now"
        found.handle(PersonAnswer(question.id, request.goes_on, request.session_id))
        return ""
    before = found.engine.head.phase
    unpausable = found.together.unpausable(before) if request.do == "pause" else ""
    if unpausable:
        return unpausable
    found.handle(_CONTROLS[request.do](request.session_id))
    question = found.engine.head.question
    if found.engine.head.phase is before:
        return question.text if question else f"not possible while it is {before.value}"
    return ""


def check_run_id(run: str) -> None:
    """Raise Refused for an invalid run id: it is part of keys and of the identities of parts."""
    if not _RUN_ID.fullmatch(run):
        raise Refused(f"{run[:40]!a} cannot be the id of a run: up to 40 letters, digits and -")


class _Pending(msgspec.Struct):
    """A pending wait: ``then`` is called when ``over`` returns True or at ``until``."""

    run: Run
    over: Callable[[], bool]
    until: float
    then: Callable[[], None]


def digest_of(program: Program, roles: Mapping[str, Sequence[str]]) -> str:
    """Return a digest of a program and its robots."""
    content = msgspec.json.encode([program, {role: list(names) for role, names in roles.items()}])
    return hashlib.blake2b(content, digest_size=8).hexdigest()
