"""Carries out the instructions of one run, one after the other, until one has to be waited for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

from fleet.missions.ending import Ending
from fleet.missions.facts import Seen
from fleet.missions.program import (
    Act,
    Again,
    Ask,
    Do,
    Enter,
    Instruction,
    Leave,
    Loop,
    Program,
    Require,
    Wait,
    WaitFor,
)
from fleet.missions.run_robots import RunRobots
from fleet.missions.spares import ENLISTED_WITHIN, Spares
from fleet.missions.state import (
    GOING_ON,
    Begun,
    Enlisted,
    Head,
    Occupy,
    Outcome,
    Part,
    Phase,
    Prepare,
    Question,
    RunOutcome,
    step_name,
)

TOLD_WITHIN = 5.0  # s after its time in which a run is told that its places were not free
PREPARED_WITHIN = 10.0  # s for all robots to say whether they could
ANSWERED_WITHIN = 600.0  # s for questions that the engine itself asks
BOUND = 10_000  # instructions without waiting, after which a run is taken for a mistake


class Steps:
    """The steps of one run; ``now`` is the time of the event that is being handled."""

    def __init__(self, program: Program, head: Head, robots: RunRobots, seen: Seen, ending: Ending) -> None:
        self.program = program
        self.head = head
        self.robots = robots
        self.seen = seen
        self.ending = ending
        self.spares = Spares(program, head, robots, seen)
        self.now = 0.0
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
        self._inner = [(at, step) for at, step in enumerate(program.steps) if isinstance(step, Enter)]

    @property
    def name(self) -> str:
        """The step that is under way, as parts name it."""
        return step_name(self.program, self.head)

    def instruction(self) -> Instruction | None:
        """Return the instruction that is under way; None behind the last."""
        return self.program.steps[self.head.at] if self.head.at < len(self.program.steps) else None

    def next(self) -> None:
        """Go to the next instruction."""
        self.head.at += 1
        self.go_on()

    def go_on(self) -> None:
        """Carry out instructions until one has to be waited for."""
        for _ in range(BOUND):
            step = self.instruction()
            if isinstance(step, Do | None) and self._fills_up():
                return
            if step is None:
                lost = self.robots.lost_any()
                self.ending.close(RunOutcome.WITH_LOSSES if lost else RunOutcome.COMPLETED, "")
                return
            self.head.serial += 1
            if step.only_if is not None and not self.seen.holds(
                step.only_if, self._of(step.only_if.role), 0.0
            ):
                self.robots.note("skipped", step=self.name)
                self.head.at = step.end if isinstance(step, Loop | Enter) else self.head.at + 1
            elif self._begin[type(step)](step):
                return
        self.ending.fail("its steps lead nowhere", self.now)

    def _fills_up(self) -> bool:
        """Let spares take the places of robots that are lost; return whether the run waits for one, or ends.

        With nobody left to ask, the robots that there are must be enough.
        """
        if self.instruction() is not None and self.spares.enlist(self.now):
            return True
        shortage = self.robots.shortage(self.program.quorum)
        if shortage:
            self.ending.fail(shortage, self.now)
        return bool(shortage)

    def enlisted(self, event: Enlisted) -> None:
        """Take the answer of a spare, and go on."""
        if self.spares.take(event, self.now):
            self.go_on()

    def occupy(self) -> None:
        """Take the places of the mission before anything begins, or wait for them."""
        self.head.phase, self.head.until = Phase.OCCUPYING, self.now + self.program.occupy_within
        self.robots.effects.append(Occupy())

    def again(self) -> None:
        """Go on with a step that a question held up: begin it, or see whether it is over."""
        step = self.instruction()
        if isinstance(step, Do) and not self.robots.parts_of(self.name):
            self._do(step)
        else:
            self.head.phase = Phase.STEP
            self.look()

    def prepared(self, robot: str, refusal: str) -> None:
        """Take a robot's word on whether it could begin; once all have said so they do."""
        if self.head.phase is not Phase.PREPARING or robot not in self._unprepared:
            return
        if refusal:
            self.fail(f"step {self.name}: {robot} cannot: {refusal}; nobody moved")
            return
        self._unprepared.discard(robot)
        step = self.instruction()
        if not self._unprepared and isinstance(step, Do):
            self._begin_all(step)

    def time_passes(self) -> None:
        """End a wait whose time is over, or whose condition holds; and a preparation that takes too long."""
        self._end_late_missions()
        late = self.now >= self.head.until
        if self.head.phase is Phase.FILLING and late:
            self.enlisted(Enlisted(self.head.enlists, f"it did not join within {ENLISTED_WITHIN:g} s"))
        if self.head.phase is Phase.OCCUPYING and self.now >= self.head.until + TOLD_WITHIN:
            self.fail("nobody said whether its places are free")
        if self.head.phase is Phase.PREPARING and late:
            missing = ", ".join(sorted(self._unprepared))
            self.fail(f"step {self.name}: {missing} did not say whether it can; nobody moved")
        if self.head.phase is not Phase.WAITING:
            return
        step = self.instruction()
        waits_for = step if isinstance(step, WaitFor) else None
        if waits_for is not None:
            condition = waits_for.condition
            if self.seen.holds(condition, self._of(condition.role), self._since):
                self.next()
                return
        if late and waits_for is not None and waits_for.fails:
            self.fail(f"step {self.name}: what it waited for did not come")
        elif late:
            self.next()

    def ask(self, text: str, about: Literal["step", "robot", "restart", "resume"]) -> None:
        """Put a question of the engine's own; without an answer the run is aborted."""
        self._put(text, about, "abort", ANSWERED_WITHIN)

    def lose(self, robot: str, outcome: Outcome, reason: str) -> None:
        """Take a robot out of the run, make it safe, and see whether the run can go on."""
        if not self.robots.lose(robot, outcome, reason, self.now) or self.head.phase not in GOING_ON:
            return
        step = self.instruction()
        doing = step if isinstance(step, Do) else None
        self._make_safe(robot, doing.failed_do if doing is not None else "hold")
        self._follow_loss(
            f"{robot}: {outcome}: {reason}", doing.failed_then if doing is not None else "continue"
        )

    def fail(self, reason: str) -> None:
        """End the mission that is under way as failed: the innermost, or the run itself."""
        inner = self._under_way()
        if inner:
            self._fail_mission(*inner[-1], reason)
        else:
            self.ending.fail(reason, self.now)

    def look(self) -> None:
        """See whether the step that robots carry out is over."""
        step = self.instruction()
        if self.head.phase is not Phase.STEP or not isinstance(step, Do | Leave):
            return
        if isinstance(step, Leave):  # of a mission within that failed: its robots are made safe first
            if not self.robots.active("halt", "secure"):
                self.next()
            return
        parts = self.robots.parts_of(self.name)
        active = [part for part in parts if part.inflight]
        through = self._is_through(step, parts)
        for part in active if through else ():
            if not self.robots.comes_down(part.robot):
                self.robots.end(part, Outcome.SKIPPED, "ended with the step", self.now)
                self.robots.halt(self.name, part.robot, self.now)
        if any(part.inflight for part in active) or self.robots.active("halt", "secure"):
            return
        if through or not parts or step.finish == "all":
            self.next()
        else:
            self.fail(f"step {self.name}: nobody that it depends on was through")

    # -- the kinds of instructions: each returns whether it has to be waited for -----------------------

    def _loop(self, step: Loop) -> bool:
        """Begin a repeat, or another round of it."""
        key = str(self.head.at)
        rounds = self.head.loops.get(key, 0)
        over = step.until is not None and self.seen.holds(step.until, self._of(step.until.role), 0.0)
        if over or rounds >= step.times:
            self.head.loops.pop(key, None)
            self.head.at = step.end
        else:
            self.head.loops[key] = rounds + 1
            self.head.at += 1
        return False

    def _again(self, step: Again) -> bool:
        """Go back to the beginning of a repeat."""
        self.head.at = step.loop
        return False

    def _wait(self, step: Wait | WaitFor) -> bool:
        """Begin to wait."""
        seconds = step.seconds if isinstance(step, Wait) else step.timeout
        self.head.phase, self.head.until, self._since = Phase.WAITING, self.now + seconds, self.now
        self.robots.note(f"waits, {seconds:g} s at the most", step=self.name)
        return True

    def _ask_step(self, step: Ask) -> bool:
        """Ask a person."""
        self.head.phase = Phase.ASKING
        self._put(step.text, "step", step.on_timeout, step.timeout)
        return True

    def _put(
        self,
        text: str,
        about: Literal["step", "robot", "restart", "resume"],
        on_timeout: Literal["continue", "abort", "fail"],
        timeout: float,
    ) -> None:
        """Put a question to a person."""
        self.head.questions += 1
        self.head.question = Question(self.head.questions, text, self.now + timeout, on_timeout, about)
        self.robots.note(f"asks: {text}", step=self.name)

    def _do(self, step: Do) -> bool:
        """Begin a step that robots carry out, when all that must be so is so."""
        self.head.phase = Phase.STEP
        for robot, _ in self._acts(step):
            lacking = self.seen.lacks(robot, self.required())
            if lacking:
                self.lose(robot, Outcome.REFUSED, lacking)
            if self.head.phase is not Phase.STEP or self.instruction() is not step:
                return True
        acts = self._acts(step)
        if not step.together or not acts:
            self._begin_all(step)
            return True
        self.head.phase, self.head.until = Phase.PREPARING, self.now + PREPARED_WITHIN
        self._unprepared = {robot for robot, _ in acts}
        self.robots.effects += [Prepare(robot, act) for robot, act in acts]
        return True

    def _begin_all(self, step: Do) -> None:
        """Begin what each robot does."""
        self.head.phase = Phase.STEP
        self.head.begun.append(Begun(self.head.at, self.name))
        for robot, act in self._acts(step):
            self.robots.begin(self.name, robot, act, "do", self.now)
        self.look()

    def _acts(self, step: Do) -> list[tuple[str, Act]]:
        """Return what each robot that still takes part does."""
        acts = ((each.robot, self.robots.act_of(each, step.acts)) for each in self.robots.within())
        return [(robot, act) for robot, act in acts if act is not None]

    def required(self) -> Require:
        """Return what the step that is under way requires of its robots."""
        step = self.instruction()
        return (isinstance(step, Do) and step.require) or self.program.require

    def _of(self, role: str) -> list[str]:
        """Return the robots of a role that still take part."""
        return [each.robot for each in self.robots.within(None if role == "all" else [role])]

    def _is_through(self, step: Do, parts: list[Part]) -> bool:
        """Return whether those that the step depends on are through, so that the others are ended."""
        if step.finish == "all":
            return False
        done = [part for part in parts if part.outcome is Outcome.DONE]
        if step.finish == "any":
            return bool(done)
        waits = any(part.inflight and self.robots.plays(part.robot, step.finish) for part in parts)
        return not waits and any(self.robots.plays(part.robot, step.finish) for part in done)

    # -- missions within the mission -------------------------------------------------------------------

    def _enter(self, step: Enter) -> bool:
        """Begin a mission within the mission, unless it has too few robots by now."""
        self.robots.note(f"mission {step.mission} begins", step=step.id)
        self.head.entered[str(self.head.at)] = self.now
        self.head.at += 1
        self.head.phase = Phase.STEP
        shortage = self.robots.shortage(step.quorum)
        if shortage:
            self.fail(shortage)
        return bool(shortage)

    def _leave(self, step: Leave) -> bool:
        """End a mission within the mission that came to its end."""
        if self.head.entered.pop(str(step.enter), None) is not None:
            self.robots.note(f"mission {self._mission_at(step.enter)} completed", step=step.id)
        self.head.at += 1
        return False

    def _mission_at(self, at: int) -> str:
        """Return the name of the mission that begins at an index."""
        return next(step.mission for index, step in self._inner if index == at)

    def _under_way(self) -> list[tuple[int, Enter]]:
        """Return the missions within the mission that are under way, the outermost first."""
        return [(at, step) for at, step in self._inner if at < self.head.at < step.end - 1]

    def _end_late_missions(self) -> None:
        """End a mission within the mission whose deadline is over; not while a person has the run."""
        question = self.head.question
        held = question is not None and question.about in ("restart", "resume")
        if self.head.phase is Phase.PAUSED or held or self.head.phase not in GOING_ON:
            return
        for at, step in self._under_way():
            began = self.head.entered.get(str(at), self.now)
            if step.deadline is not None and self.now - began >= step.deadline:
                self._fail_mission(at, step, f"its deadline of {step.deadline:g} s is over")
                return

    def _fail_mission(self, at: int, inner: Enter, reason: str) -> None:
        """End a mission within the mission: its robots have failed in the step that carries it."""
        why = f"mission {inner.mission} failed: {reason}"
        self.robots.note(why, step=inner.id)
        for index, _ in self._under_way():
            if index >= at:
                self.head.entered.pop(str(index), None)
        question = self.head.question
        self.head.at = inner.end - 1
        self.head.serial += 1
        if question is None or question.about not in ("restart", "resume"):
            self.head.question = None
        if self.head.phase is Phase.PAUSED:
            self.head.paused_from = Phase.STEP
        elif self.head.question is None:
            self.head.phase = Phase.STEP
        for member in self.robots.within([inner.role]):
            self.robots.lose(member.robot, Outcome.FAILED, why, self.now)
            self._make_safe(member.robot, inner.failed_do)
        self._follow_loss(why, inner.failed_then)
        self.look()

    def _make_safe(self, robot: str, how: str) -> None:
        """Bring a robot that is out to a standstill, or let it do what the step says instead."""
        if how == "hold":
            self.robots.halt(self.name, robot, self.now)
        else:
            self.robots.begin(self.name, robot, Act("command", how), "secure", self.now)

    def _follow_loss(self, why: str, then: Literal["continue", "wait", "fail"]) -> None:
        """See whether the run, and each mission within it that is under way, can go on without a robot."""
        shortage = self.robots.shortage(self.program.quorum, with_spares=True)
        if shortage:
            self.ending.fail(f"{why}; {shortage}", self.now)
            return
        for at, step in self._under_way():
            shortage = self.robots.shortage(step.quorum)
            if shortage:
                self._fail_mission(at, step, f"{why}; {shortage}")
                return
        if then == "fail":
            self.fail(why)
        elif then == "wait" and self.head.phase is Phase.STEP:
            self.head.phase = Phase.ASKING
            self.ask(f"{why}. Go on without it?", "robot")
