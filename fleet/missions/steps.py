"""Executes the instructions of one run in order, until one must wait."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from fleet.missions.ending import Ending
from fleet.missions.facts import RobotFacts
from fleet.missions.inner_missions import InnerMissions
from fleet.missions.losses import RobotLosses, put_question
from fleet.missions.program import (
    Again,
    Ask,
    Do,
    Enter,
    Leave,
    Loop,
    Program,
    Wait,
    WaitFor,
)
from fleet.missions.run_robots import RunRobots, first_identity
from fleet.missions.spares import ENLISTED_WITHIN, Spares
from fleet.missions.state import (
    GOING_ON,
    Enlisted,
    NotStarted,
    Occupy,
    PartOutcome,
    Phase,
    Prepare,
    RunHead,
    RunOutcome,
    StepPart,
    UndoableStep,
    instruction_of,
    required,
    step_name,
)

INFORMED_WITHIN = 5.0  # s after the deadline for places within which the run must be informed of the failure
PREPARED_WITHIN = 15.0  # s for all robots to report whether they can begin
BOUND = 10_000  # instructions without a wait before the run counts as an endless loop


class StepRunner:
    """The steps of one run; ``losses.now`` is the time of the present event."""

    def __init__(
        self, program: Program, head: RunHead, robots: RunRobots, seen: RobotFacts, ending: Ending
    ) -> None:
        self.program = program
        self.head = head
        self.robots = robots
        self.seen = seen
        self.ending = ending
        self.inner = InnerMissions(program, head, robots)
        self.spares = Spares(program, head, robots, seen)
        self.losses = RobotLosses(program, head, robots, self.inner, ending=ending, check=self.check)
        self._since = 0.0
        self._unprepared: set[str] = set()
        self._begin: Mapping[type, Callable[..., bool]] = {
            Do: self._do,
            Wait: self._wait,
            WaitFor: self._wait,
            Ask: self._ask_step,
            Loop: self._loop,
            Again: self._again,
            Enter: self._enter,
            Leave: self._leave,
        }

    @property
    def name(self) -> str:
        """The name of the present step, as used in parts."""
        return step_name(self.program, self.head)

    def next(self) -> None:
        """Go to the next instruction."""
        self.head.at += 1
        self.run_until_wait()

    def run_until_wait(self) -> None:
        """Execute instructions until one must wait."""
        for _ in range(BOUND):
            step = instruction_of(self.program, self.head)
            if isinstance(step, Do | None) and self._fills_up():
                return
            if step is None:
                lost = self.robots.has_lost_robot()
                self.ending.close(RunOutcome.WITH_LOSSES if lost else RunOutcome.COMPLETED, "")
                return
            self.head.serial += 1
            if step.only_if is not None and not self.seen.holds(
                step.only_if, _names(self.robots, step.only_if.role), 0.0
            ):
                self.robots.note("The step is skipped: its condition does not hold", step=self.name)
                self.head.at = step.end if isinstance(step, Loop | Enter) else self.head.at + 1
            elif self._begin[type(step)](step):
                return
        self.ending.fail("its steps lead nowhere", self.losses.now)

    def _fills_up(self) -> bool:
        """Let spares replace lost robots; return True if the run waits for one, or ends.

        Without further spares, the present robots must satisfy the quorum.
        """
        if instruction_of(self.program, self.head) is not None and self.spares.request_spare(self.losses.now):
            return True
        shortage = self.robots.shortage(self.program.quorum)
        if shortage:
            self.ending.fail(shortage, self.losses.now)
        return bool(shortage)

    def handle_spare_answer(self, event: Enlisted) -> None:
        """Handle the answer of a spare, and continue."""
        if self.spares.handle(event, self.losses.now):
            self.run_until_wait()

    def occupy(self) -> None:
        """Occupy the places of the mission before anything begins, or wait for them."""
        self.head.phase, self.head.until = Phase.OCCUPYING, self.losses.now + self.program.occupy_within
        self.robots.effects.append(Occupy())

    def again(self) -> None:
        """Continue a step that waited for an answer: begin it, or check its completion."""
        step = instruction_of(self.program, self.head)
        if isinstance(step, Do) and not self.robots.parts_of(self.name):
            self._do(step)
        else:
            self.head.phase = Phase.STEP
            self.check()

    def prepared(self, robot: str, refusal: str) -> None:
        """Handle a robot's report whether it can begin; begin when all can."""
        if self.head.phase is not Phase.PREPARING or robot not in self._unprepared:
            return
        if refusal:
            self.losses.fail(f"step {self.name}: {robot} cannot: {refusal}; no robot moved")
            return
        self._unprepared.discard(robot)
        step = instruction_of(self.program, self.head)
        if not self._unprepared and isinstance(step, Do):
            self._begin_all(step)

    def not_started(self, event: NotStarted) -> None:
        """End a step whose coordinated start failed."""
        step = instruction_of(self.program, self.head)
        if event.step != self.name or not isinstance(step, Do) or self.head.phase not in GOING_ON:
            return
        for part in self.robots.parts_of(self.name):
            self.robots.end(part, PartOutcome.SKIPPED, "no robot was started", self.losses.now)
        self.head.undoable.pop()
        self.losses.fail(f"step {self.name}: {event.reason}; no robot moved")

    def time_passes(self) -> None:
        """End a wait that is over or fulfilled, and a preparation that takes too long."""
        self.losses.time_passes()
        late = self.losses.now >= self.head.until
        if self.head.phase is Phase.FILLING and late:
            self.handle_spare_answer(
                Enlisted(self.head.enlists, f"it did not join within {ENLISTED_WITHIN:g} s")
            )
        if self.head.phase is Phase.OCCUPYING and self.losses.now >= self.head.until + INFORMED_WITHIN:
            self.losses.fail("no answer whether its places are free")
        if self.head.phase is Phase.PREPARING and late:
            missing = ", ".join(sorted(self._unprepared))
            self.losses.fail(f"step {self.name}: {missing} did not say whether it can; no robot moved")
        if self.head.phase is not Phase.WAITING:
            return
        step = instruction_of(self.program, self.head)
        waits_for = step if isinstance(step, WaitFor) else None
        if waits_for is not None:
            condition = waits_for.condition
            if self.seen.holds(condition, _names(self.robots, condition.role), self._since):
                self.next()
                return
        if late and waits_for is not None and waits_for.fails:
            self.losses.fail(f"step {self.name}: its condition did not occur in time")
        elif late:
            self.next()

    def check(self) -> None:
        """Check the completion of the step that robots execute; one that prepares waits for no lost robot."""
        if self.head.phase is Phase.PREPARING:
            for robot in self._unprepared.difference(member.robot for member in self.robots.within()):
                self.prepared(robot, "")
            return
        step = instruction_of(self.program, self.head)
        if self.head.phase is not Phase.STEP or not isinstance(step, Do | Leave):
            return
        if isinstance(step, Leave):  # of a failed inner mission: its robots are made safe first
            if not self.robots.active("halt", "secure"):
                self.next()
            return
        parts = self.robots.parts_of(self.name)
        active = [part for part in parts if part.inflight]
        through = _is_through(step, parts, self.robots)
        # followers continue until all others have finished
        led = all(part.act.verb == "follow" for part in active)
        for part in active if through or led else ():
            if not self.robots.comes_down(part.robot):
                outcome = PartOutcome.DONE if part.act.verb == "follow" else PartOutcome.SKIPPED
                self.robots.end(part, outcome, "ended with the step", self.losses.now)
                self.robots.halt(self.name, part.robot, self.losses.now)
        if any(part.inflight for part in active) or self.robots.active("halt", "secure"):
            return
        if through or not parts or step.finish == "all":
            self.next()
        else:
            self.losses.fail(f"step {self.name}: no robot that it depends on has finished")

    # -- kinds of instructions: each returns whether it must wait --------------------------------------

    def _loop(self, step: Loop) -> bool:
        """Begin a repeat, or its next round."""
        key = str(self.head.at)
        rounds = self.head.loops.get(key, 0)
        over = step.until is not None and self.seen.holds(
            step.until, _names(self.robots, step.until.role), 0.0
        )
        if over or rounds >= step.times:
            self.head.loops.pop(key, None)
            self.head.at = step.end
        else:
            self.head.loops[key] = rounds + 1
            self.head.at += 1
        return False

    def _again(self, step: Again) -> bool:
        """Jump to the start of a repeat."""
        self.head.at = step.loop
        return False

    def _wait(self, step: Wait | WaitFor) -> bool:
        """Begin to wait."""
        seconds = step.seconds if isinstance(step, Wait) else step.timeout
        self.head.phase, self.head.until, self._since = (
            Phase.WAITING,
            self.losses.now + seconds,
            self.losses.now,
        )
        self.robots.note(f"The run waits {seconds:g} s at the most", step=self.name)
        return True

    def _ask_step(self, step: Ask) -> bool:
        """Ask a person."""
        self.head.phase = Phase.ASKING
        until, on_timeout = self.losses.now + step.timeout, step.on_timeout
        put_question(self.head, self.robots, self.name, step.text, until=until, on_timeout=on_timeout)
        return True

    def _do(self, step: Do) -> bool:
        """Begin a step of robots, if all requirements are met."""
        self.head.phase = Phase.STEP
        for robot, act in self.robots.acts_of(step.acts):
            no_leader = "there is no robot left to follow" if act.verb == "follow" and not act.value else ""
            lacking = no_leader or self.seen.lacks(robot, required(self.program, self.head))
            if lacking:
                self.losses.lose(robot, PartOutcome.REFUSED, lacking)
            if self.head.phase is not Phase.STEP or instruction_of(self.program, self.head) is not step:
                return True
        acts = self.robots.acts_of(step.acts)
        if not step.together or not acts:
            self._begin_all(step)
            return True
        self.head.phase, self.head.until = Phase.PREPARING, self.losses.now + PREPARED_WITHIN
        self._unprepared = {robot for robot, _ in acts}
        self.robots.effects += [
            Prepare(robot, act, first_identity(self.robots.run, self.name, robot)) for robot, act in acts
        ]
        return True

    def _begin_all(self, step: Do) -> None:
        """Begin the part of each robot."""
        self.head.phase = Phase.STEP
        self.head.undoable.append(UndoableStep(self.head.at, self.name))
        if step.together:
            self.robots.begin_together(self.name, self.robots.acts_of(step.acts), self.losses.now)
        for robot, act in () if step.together else self.robots.acts_of(step.acts):
            self.robots.begin(self.name, robot, act, "do", self.losses.now)
        self.check()

    # -- inner missions --------------------------------------------------------------------------------

    def _enter(self, step: Enter) -> bool:
        """Begin an inner mission, unless it has too few robots by now."""
        self.inner.enter(step, self.losses.now)
        self.head.at += 1
        self.head.phase = Phase.STEP
        shortage = self.robots.shortage(step.quorum)
        if shortage:
            self.losses.fail(shortage)
        return bool(shortage)

    def _leave(self, step: Leave) -> bool:
        """Complete an inner mission."""
        self.inner.leave(step)
        self.head.at += 1
        return False


def _is_through(step: Do, parts: list[StepPart], robots: RunRobots) -> bool:
    """Return True if the robots on which the step depends have finished, so that the others are ended."""
    if step.finish == "all":
        return False
    done = [part for part in parts if part.outcome is PartOutcome.DONE and part.act.verb != "follow"]
    if step.finish == "any":
        return bool(done)
    waits = any(part.inflight and robots.plays(part.robot, step.finish) for part in parts)
    return not waits and any(robots.plays(part.robot, step.finish) for part in done)


def _names(robots: RunRobots, role: str) -> list[str]:
    """Return the robots of a role, or of all, that still take part."""
    return [each.robot for each in robots.within(None if role == "all" else [role])]
