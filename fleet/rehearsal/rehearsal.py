"""One rehearsal: the mission's runner and engine on simulated robots, to the end of the run."""

from __future__ import annotations

import asyncio
import itertools
import time
from collections.abc import Callable, Container, Iterator, Mapping, Sequence

import msgspec

from fleet.clock import Clock
from fleet.config.missions import Mission
from fleet.errors import FleetError
from fleet.host.edge.mission_robots import LocalRunPort, can, trouble
from fleet.host.edge.rehearsal_task import RehearsalLine, RehearsalTask
from fleet.host.requests.stop_cause import local_cause
from fleet.missions.model import MissionConfig
from fleet.missions.points import SiteMap
from fleet.missions.program import Program, WaitFor
from fleet.missions.rehearsal import RehearsalResult, RehearsedRobot
from fleet.missions.report import MissionStartRequest, RunControlRequest, RunState
from fleet.missions.roles import RoleCandidate
from fleet.missions.run import Run
from fleet.missions.runs import Runs
from fleet.missions.state import Facts, PartOutcome, Phase, RunOutcome, instruction_of
from fleet.model.command import Origin, Transport
from fleet.model.state import RobotState
from fleet.rehearsal.common_start import SimulatedStart
from fleet.rehearsal.recording import MOVES, Distances, MemoryStore, Tracks
from fleet.rehearsal.simulated_robots import SimulatedRobots, substitutes_of
from fleet.runtime.simulated_time import JumpingLoop, LoopClock

RUN = "rehearsal"
STEP = 0.1  # s between samples of the robots
POLL_INTERVAL = 2  # steps between two polls of the run, as in the edge
READY_WITHIN = 60.0  # s for the simulated robots to come online
SETTLE = 10.0  # s more until aircraft can be armed
WAITED = 30.0  # s that a rehearsal waits for conditions which it cannot produce
LONGEST = 12 * 3600.0  # simulated s
WITHIN = 600.0  # s of computing time that a rehearsal may take
TELL = 0.5  # s of computing time between progress reports


class Unrehearsable(Exception):
    """A rehearsal is not possible; the message says why."""


class Rehearsal:
    """One rehearsal. ``tell`` receives its progress; ``within``: its limit of computing time in s."""

    def __init__(self, task: RehearsalTask, tell: Callable[[RehearsalLine], None], within: float) -> None:
        self._task = task
        self._tell = tell
        self._within = within
        self._began = self._reported_at = time.monotonic()
        self._clock: Clock = LoopClock(asyncio.get_running_loop())
        self._robots = SimulatedRobots(substitutes_of(task), task.site, self._clock, self._heard)
        self._store = MemoryStore(lambda note: tell(RehearsalLine(note.at, note.step, note)))
        self._policies = {name: player.policy for name, player in self._robots.players.items()}
        self._members: dict[str, str] = {}
        for role, names in task.roles.items():
            for name in names:
                self._members.setdefault(name, role)
        self._assumed = [*_absent(task, self._robots.players)]
        self._last: RunState | None = None
        self._runs = Runs(
            "rehearsal",
            {name: LocalRunPort(robot) for name, robot in self._robots.robots.items()},
            candidates=self._candidates,
            allowed=self._refusal,
            site=SiteMap(task.places, task.site),
            blocker=lambda *_: "",  # the robots refuse it themselves, and the result shows that
            edge_of=lambda _: "",
            together=lambda: SimulatedStart(self._robots.robots, self._soon),
            store=self._store,
            clock=self._clock,
            soon=self._soon,
            stop=self._stop,
            on_change=self._state_is,
        )

    @staticmethod
    def _soon(call: Callable[[], None]) -> None:
        """Run a call on the event loop."""
        asyncio.get_running_loop().call_soon(call)

    async def carry_out(self) -> RehearsalResult:
        """Execute the mission and return the result; raises Unrehearsable."""
        async with self._robots.running():
            await self._ready()
            before = {name: self._state(name).battery for name in self._members}
            self._start()
            run = await self._joined_run()
            distances = Distances(self._members)
            tracks = Tracks(self._members)
            late = await self._follow(run, distances, tracks)
            result = self._result(run, distances, before, late)
            return msgspec.structs.replace(result, tracks=tracks.all())

    # -- robots ----------------------------------------------------------------------------------------

    def _state(self, name: str) -> RobotState:
        """Return the present state of a robot."""
        return self._robots.robots[name].state()

    async def _ready(self) -> None:
        """Wait until all robots are online; raises Unrehearsable."""
        for _ in range(round(READY_WITHIN / STEP)):
            if all(self._state(name).reachable for name in self._members):
                await asyncio.sleep(SETTLE)
                return
            await asyncio.sleep(STEP)
        lost = [
            f"{name}: {state.cause}" for name in self._members if not (state := self._state(name)).reachable
        ]
        raise Unrehearsable(f"simulated robots do not answer: {'; '.join(lost)}")

    def _candidates(self) -> list[RoleCandidate]:
        """Return all robots as candidates for roles."""
        found = []
        for name, robot in self._robots.robots.items():
            state, description = robot.state(), robot.describe()
            at = state.site or state.position
            position = (at.x, at.y, at.z) if at is not None else None
            facts = Facts(name, state.health, state.battery, position, state.activity)
            groups = frozenset(group for group, names in self._task.groups.items() if name in names)
            why_not = trouble(state, description)
            found.append(
                RoleCandidate(name, state.adapter, can(description), facts, groups, why_not, state.run)
            )
        return found

    def _refusal(self, robot: str, origin: Origin, commands: bool, navigates: bool) -> str | None:  # noqa: FBT001 - by position
        """Return why a sender may not start a mission with a robot; None if he may."""
        return self._policies[robot].mission_refusal(origin, commands=commands, navigates=navigates)

    def _stop(self, names: tuple[str, ...], why: str) -> None:
        """Set the emergency stop of robots."""
        cause = local_cause("", why)
        for name in names:
            robot = self._robots.robots[name]
            robot.controller.latch.engage(cause.sentence)
            robot.controller.halt(emergency=True)
            robot.requests.follow_emergency(cause)

    def _heard(self, robot: str, event: str) -> None:
        """Handle an event of a robot."""
        self._runs.handle_event(robot, event)

    # -- run -------------------------------------------------------------------------------------------

    def _start(self) -> None:
        """Start the mission with the authority of its sender; raises Unrehearsable."""
        task = self._task
        self._runs.filling.rehearsed = lambda *_: ""  # this is the rehearsal
        mission = Mission(task.name, {}, MissionConfig.model_validate_json(task.mission))
        request = MissionStartRequest(
            robots=task.roles, run=RUN, session_id=task.session_id, source_type=task.source_type
        )
        self._refused: str | None = None

        def began(_run: str, _roles: Mapping[str, Sequence[str]], refusal: str) -> None:
            self._refused = refusal

        self._runs.start(mission, without_long_waits(task.program), request, Transport(task.transport), began)

    async def _joined_run(self) -> Run:
        """Return the run after its robots have joined it; raises Unrehearsable."""
        while self._refused is None:
            await asyncio.sleep(STEP)
            self._runs.poll()
        if self._refused:
            raise Unrehearsable(self._refused)
        return self._runs.all()[0]

    def _state_is(self, state: RunState) -> None:
        """Store the state of the run."""
        self._last = state

    async def _follow(self, run: Run, distances: Distances, tracks: Tracks) -> str:
        """Follow the run to its end; return why it was cut short, empty if it ended."""
        for step in itertools.count():
            if run.engine.over:
                return ""
            await asyncio.sleep(STEP)
            robots = ((name, self._robots.traffic.one(name)) for name in self._robots.robots)
            placed = {name: each for name, each in robots if each is not None}
            distances.sample(placed, run.now)
            tracks.sample(placed, run.now)
            self._note_wait(run)
            if step % POLL_INTERVAL == 0:
                self._runs.poll()
                self._answer(run)
                self._report_progress(run)
            if run.now >= LONGEST:
                return f"it had not ended after {LONGEST / 3600:g} simulated hours"
            if time.monotonic() - self._began >= self._within:
                return f"{run.now:.0f} s were simulated when its {self._within / 60:g} min were over"
        raise AssertionError

    def _answer(self, run: Run) -> None:
        """Answer a question of the mission with continue; other questions stay without an answer."""
        question = run.engine.head.question
        if question is not None and question.about == "step":
            self._assumed.append(f"a person answers {question.text!r} with: continue")
            request = RunControlRequest(
                "answer", question=question.id, goes_on=True, session_id="the rehearsal"
            )
            self._runs.control(RUN, request)

    def _note_wait(self, run: Run) -> None:
        """Record a wait that times out: its condition is assumed to be fulfilled."""
        step, head = instruction_of(run.engine.program, run.engine.head), run.engine.head
        if head.phase is Phase.WAITING and isinstance(step, WaitFor) and run.now >= head.until:
            self._assumed.append(f"what step {step.id} waits for comes, or its time runs out")

    def _report_progress(self, run: Run) -> None:
        """Report progress periodically."""
        now = time.monotonic()
        if now - self._reported_at >= TELL:
            self._reported_at = now
            self._tell(RehearsalLine(round(run.now, 1), run.engine.steps.name))

    # -- result ----------------------------------------------------------------------------------------

    def _result(
        self, run: Run, distances: Distances, before: Mapping[str, float | None], late: str
    ) -> RehearsalResult:
        """Return the result."""
        head = run.engine.head
        outcome = head.outcome or RunOutcome.UNKNOWN
        robots = [self._robot(run, name, before.get(name)) for name in sorted(self._robots.robots)]
        troubles = (
            [late or head.reason or f"it ended {outcome}"] if outcome is not RunOutcome.COMPLETED else []
        )
        lost = [
            f"{each.robot}: {each.outcome}: {each.reason}".rstrip(": ")
            for each in robots
            if each.outcome not in {"", PartOutcome.DONE}
        ]
        troubles += [each for each in lost if not any(each in said for said in troubles)]
        troubles += [
            f"{' and '.join(each.robots)} came within {each.metres:g} m, {each.kept:g} m are kept"
            for each in distances.too_near()
        ]
        return RehearsalResult(
            self._task.name,
            outcome.value,
            round(run.now, 1),
            late or head.reason,
            tuple(dict.fromkeys(troubles)),
            tuple(robots),
            self._store.timeline(),
            tuple(self._store.notes),
            distances.nearest(),
            tuple(dict.fromkeys(self._assumed)),
            self._task.seed,
            round(time.monotonic() - self._began, 1),
        )

    def _robot(self, run: Run, name: str, before: float | None) -> RehearsedRobot:
        """Return the result of one robot."""
        player, member = self._robots.players[name], run.engine.robots.members.get(name)
        outcome = member.outcome if member is not None else None
        return RehearsedRobot(
            name,
            player.played_by,
            player.simulation is None,
            self._members.get(name, ""),
            outcome.value if outcome is not None else "",
            member.reason if member is not None else "",
            before,
            self._state(name).battery if member is not None else None,
        )


def without_long_waits(program: Program) -> Program:
    """Return a program with short waits for conditions that a rehearsal cannot produce."""
    steps = tuple(
        msgspec.structs.replace(step, timeout=min(step.timeout, WAITED), fails=False)
        if isinstance(step, WaitFor)
        else step
        for step in program.steps
    )
    return msgspec.structs.replace(program, steps=steps)


def _absent(task: RehearsalTask, there: Container[str]) -> Iterator[str]:
    """Yield the robots without a position, and those whose present motion is ignored."""
    taking_part = {name for names in task.roles.values() for name in names}
    for placed in task.robots:
        state = placed.state
        if state.name not in there:
            yield f"{state.name} is ignored: its position is unknown"
        elif state.name not in taking_part and (state.activity or (state.speed or 0.0) > MOVES):
            yield f"{state.name} stays where it is, though it moves now"


def rehearse(
    task: RehearsalTask, tell: Callable[[RehearsalLine], None], within: float = WITHIN
) -> RehearsalLine:
    """Execute a rehearsal in simulated time; return its last line. ``within``: s of computing time."""

    async def carry_out() -> RehearsalResult:
        return await Rehearsal(task, tell, within).carry_out()

    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        try:
            return RehearsalLine(result=runner.run(carry_out()))
        except (Unrehearsable, FleetError) as error:
            return RehearsalLine(failure=str(error))
