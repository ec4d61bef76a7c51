"""The state machine of one mission run. It takes events and returns effects; it has no bus, disk or clock.

``handle`` takes an event with its time on the run's clock and returns the effects. The caller saves
``changes`` before it carries out any effect, so that a saved part is never started twice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from fleet.missions.ending import Ending
from fleet.missions.facts import RobotFacts
from fleet.missions.pausing import Pausing
from fleet.missions.program import Program
from fleet.missions.run_robots import RunRobots
from fleet.missions.state import (
    GOING_ON,
    Abort,
    Enlisted,
    Facts,
    Left,
    NotStarted,
    PartOutcome,
    Pause,
    PersonAnswer,
    Phase,
    PlaceOccupied,
    Question,
    Replied,
    Restarted,
    Resume,
    RobotEvent,
    RobotPrepared,
    RunEffect,
    RunEvent,
    RunHead,
    RunMember,
    Start,
    StepPart,
    StopAll,
    Tick,
)
from fleet.missions.steps import StepRunner

RETRIED = frozenset({PartOutcome.FAILED, PartOutcome.REFUSED})


class Engine:
    """One mission run. ``head``, ``members`` and ``parts`` are its saved state."""

    def __init__(
        self,
        run: str,
        program: Program,
        members: Iterable[RunMember],
        *,
        head: RunHead | None = None,
        parts: Iterable[StepPart] = (),
    ) -> None:
        self.program = program
        self.head = head or RunHead()
        self.robots = RunRobots(run, members, parts)
        self.seen = RobotFacts()
        self.ending = Ending(program, self.head, self.robots)
        self.steps = StepRunner(program, self.head, self.robots, self.seen, self.ending)
        self.pausing = Pausing(program, self.head, self.robots, self.seen, self.steps)
        self._handlers: Mapping[type, Callable[..., None]] = {
            Start: self._start,
            Restarted: self._restarted,
            Tick: self._tick,
            Replied: self._replied,
            RobotPrepared: lambda event: self.steps.prepared(event.robot, event.refusal),
            PlaceOccupied: self._occupied,
            Enlisted: self.steps.handle_spare_answer,
            NotStarted: self.steps.not_started,
            Facts: self._facts,
            RobotEvent: lambda event: self.seen.record_event(event.robot, event.event, self._now),
            Left: self._left,
            PersonAnswer: self._answer,
            Pause: self.pausing.pause,
            Resume: self.pausing.resume,
            Abort: lambda event: self.ending.abort(
                f"aborted by {event.by or 'an unknown sender'}", self._now
            ),
            StopAll: self._stop_all,
        }

    @property
    def over(self) -> bool:
        """True once the run has ended."""
        return self.head.phase is Phase.ENDED

    @property
    def _now(self) -> float:
        """The time of the current event."""
        return self.steps.losses.now

    def handle(self, event: RunEvent, now: float) -> list[RunEffect]:
        """Process an event at ``now``, in seconds of the run's clock; return its effects in order."""
        self.steps.losses.now = now
        if not self.over:
            self._handlers[type(event)](event)
        effects, self.robots.effects = self.robots.effects, []
        return effects

    def changes(self) -> list[StepPart | RunMember]:
        """Return the members and parts that have changed since the last call."""
        touched, self.robots.touched = self.robots.touched, {}
        return list(touched.values())

    def _start(self, _event: Start) -> None:
        """Begin with the first step, once the run has its places."""
        if self.head.phase is Phase.NEW and self.program.occupies:
            self.steps.occupy()
        elif self.head.phase is Phase.NEW:
            self.steps.run_until_wait()

    def _occupied(self, event: PlaceOccupied) -> None:
        """Begin the run, or record what it waits for; fail it when the wait has timed out."""
        if self.head.phase is not Phase.OCCUPYING:
            return
        if event.late:
            self.ending.fail(event.late, self._now)
        elif event.waits_for:
            self.head.waits_for = event.waits_for
            self.robots.note(f"The run waits for {event.waits_for}")
        else:
            self.head.waits_for = ""
            self.steps.run_until_wait()

    def _facts(self, event: Facts) -> None:
        """Update what is known of a robot; progress extends the time limits of its active parts."""
        before = self.seen.replace(event)
        if before is None or before.progress == event.progress or not event.progress:
            return
        for part in self.robots.active("do", "undo", "abort", "secure"):
            if part.robot == event.robot:
                part.until = max(part.until, self._now + part.act.timeout)

    def _replied(self, event: Replied) -> None:
        """Process the outcome of a part."""
        part = self.robots.parts.get(event.identity)
        if part is None or not part.inflight or event.outcome is None:
            return
        current = self.head.phase is Phase.STEP and part.step == self.steps.name
        again = event.outcome in RETRIED and part.attempt <= part.act.retry
        self.robots.end(part, event.outcome, event.reason, self._now)
        if part.kind != "do" or self.head.phase not in GOING_ON:
            self.ending.ended(part, self._now)
        elif again and current:
            self.robots.begin(part.step, part.robot, part.act, "do", self._now, attempt=part.attempt + 1)
        elif event.outcome is not PartOutcome.DONE:
            self.steps.losses.lose(part.robot, event.outcome, event.reason)
        self.steps.check()

    def _left(self, event: Left) -> None:
        """Record that a robot has left the run, and check whether the run can continue."""
        member = self.robots.members.get(event.robot)
        if member is None or not member.ours:
            return
        self.steps.losses.lose(event.robot, event.outcome, event.reason)
        self.ending.check(self._now)
        self.steps.check()

    def _stop_all(self, event: StopAll) -> None:
        """End the run; robots that are not stopped yet are halted, and nothing is undone."""
        for robot in event.robots:
            if robot in self.robots.members:
                self.robots.lose(robot, PartOutcome.STOPPED, event.reason, self._now)
        self.ending.stopped(event.reason, self._now)

    def _answer(self, event: PersonAnswer) -> None:
        """Apply a person's answer; a paused run only accepts the answer to its resume question."""
        question = self.head.question
        if question is None or question.id != event.question or not self._decidable(question):
            return
        what = "continue" if event.goes_on else "abort"
        self.robots.note(f"{event.by or 'Somebody'} answered: {what}", step=self.steps.name)
        self._decide(question, what, event.by)

    def _decidable(self, question: Question) -> bool:
        """Return whether an answer or a timeout takes effect now; a paused run begins nothing."""
        return self.head.phase is not Phase.PAUSED or question.about == "resume"

    def _decide(self, question: Question, what: str, by: str) -> None:
        """Apply an answer or the default of a timeout."""
        self.head.question = None
        if what == "abort":
            self.ending.abort(f"{question.text} abort" + (f" by {by}" if by else ""), self._now)
        elif what == "fail":
            self.steps.losses.fail(f"{question.text} no answer")
            self.steps.check()
        elif question.about == "resume":
            self.pausing.resume(Resume(by), confirmed=True)
        elif question.about == "robot":
            self.steps.again()
        else:
            self.steps.next()

    def _tick(self, _event: Tick) -> None:
        """Process time limits: the deadline, the open question, parts and steps."""
        head, deadline = self.head, self.program.deadline
        if deadline is not None and self._now >= deadline:
            self.ending.fail(f"the deadline of {deadline:g} s is over", self._now)
        question = head.question
        if question is not None and self._now >= question.until and self._decidable(question):
            self.robots.note(f"No answer in time: {question.on_timeout}", step=self.steps.name)
            self._decide(question, question.on_timeout, "")
        self._time_out()
        self.steps.time_passes()
        self.ending.check(self._now)
        self.steps.check()

    def _time_out(self) -> None:
        """Time out late parts; while the run is paused, those of the mission are not timed out."""
        for part in self.robots.active():
            paused = self.head.phase is Phase.PAUSED and part.kind == "do"
            if self._now < part.until or paused or not part.inflight:
                continue
            late = PartOutcome.UNKNOWN if part.kind == "halt" else PartOutcome.LATE
            reason = f"not seen done within {part.act.timeout:g} s; seen: {self.seen.words(part.robot)}"
            self.robots.end(part, late, reason, self._now)
            if part.kind == "do" and self.head.phase in GOING_ON:
                self.steps.losses.lose(part.robot, PartOutcome.LATE, reason)
            else:
                self.ending.ended(part, self._now)

    def _restarted(self, _event: Restarted) -> None:
        """Restore a run of an earlier process; interrupted parts are unknown and are not started again."""
        cut_off = self.robots.active()
        for part in cut_off:
            seen = self.seen.words(part.robot)
            reason = f"the edge restarted meanwhile; seen: {seen}"
            self.robots.end(part, PartOutcome.UNKNOWN, reason, self._now)
        self.robots.note(
            "The edge restarted; the outcome of active commands is unknown", step=self.steps.name
        )
        if self.head.phase not in GOING_ON:
            self.ending.restarted(self._now)
            return
        before = self.head.paused_from if self.head.phase is Phase.PAUSED else self.head.phase
        within = bool(cut_off) or before is Phase.STEP
        policy = self.program.on_restart
        if policy == "fail":
            self.ending.fail(f"the edge restarted in step {self.steps.name}", self._now, undoes=False)
        elif within:
            self._ask_where_to_go_on()
        elif policy == "continue":
            self.pausing.continue_between_steps()
        elif self.head.question is None:
            self._pause_after_restart()

    def _ask_where_to_go_on(self) -> None:
        """Halt all robots and ask whether to continue: the progress within the step is unknown."""
        for member in self.robots.ours():
            self.robots.halt(self.steps.name, member.robot, self._now)
        self.head.phase = Phase.ASKING
        self.steps.losses.ask(
            f"The edge restarted in step {self.steps.name}. Continue with the next step?", "restart"
        )

    def _pause_after_restart(self) -> None:
        """Ask whether to continue; nothing was in progress."""
        self.pausing.begin()
        self.steps.losses.ask(
            f"The edge restarted before the end of step {self.steps.name}. Resume?", "resume"
        )
