"""The engine of one run: events in, effects out. No bus, no disk, no clock of its own.

``handle`` takes an event at a time of the run's clock and returns what is to be done. The caller records
``changes`` before it carries out any of it: a part that was recorded is never begun again, whatever happens.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from fleet.missions.ending import Ending
from fleet.missions.facts import Seen
from fleet.missions.pausing import Pausing
from fleet.missions.program import Program
from fleet.missions.run_robots import RunRobots
from fleet.missions.state import (
    GOING_ON,
    Abort,
    Answer,
    Effect,
    Enlisted,
    Event,
    Facts,
    Head,
    Heard,
    Left,
    Member,
    NotStarted,
    Occupied,
    Outcome,
    Part,
    Pause,
    Phase,
    Prepared,
    Question,
    Replied,
    Restarted,
    Resume,
    Start,
    StopAll,
    Tick,
)
from fleet.missions.steps import Steps

RETRIED = frozenset({Outcome.FAILED, Outcome.REFUSED})


class Engine:
    """One run. ``head``, ``members`` and ``parts`` are its state, as they were recorded."""

    def __init__(
        self,
        run: str,
        program: Program,
        members: Iterable[Member],
        *,
        head: Head | None = None,
        parts: Iterable[Part] = (),
    ) -> None:
        self.program = program
        self.head = head or Head()
        self.robots = RunRobots(run, members, parts)
        self.seen = Seen()
        self.ending = Ending(program, self.head, self.robots)
        self.steps = Steps(program, self.head, self.robots, self.seen, self.ending)
        self.pausing = Pausing(program, self.head, self.robots, self.seen, self.steps)
        self._handlers: Mapping[type, Callable[..., None]] = {
            Start: self._start,
            Restarted: self._restarted,
            Tick: self._tick,
            Replied: self._replied,
            Prepared: lambda event: self.steps.prepared(event.robot, event.refusal),
            Occupied: self._occupied,
            Enlisted: self.steps.enlisted,
            NotStarted: self.steps.not_started,
            Facts: self._facts,
            Heard: lambda event: self.seen.heard(event.robot, event.event, self._now),
            Left: self._left,
            Answer: self._answer,
            Pause: self.pausing.pause,
            Resume: self.pausing.resume,
            Abort: lambda event: self.ending.abort(f"aborted by {event.by or 'somebody'}", self._now),
            StopAll: self._stop_all,
        }

    @property
    def over(self) -> bool:
        """True once the run has ended."""
        return self.head.phase is Phase.ENDED

    @property
    def _now(self) -> float:
        """The time of the event that is being handled."""
        return self.steps.losses.now

    def handle(self, event: Event, now: float) -> list[Effect]:
        """Take an event; ``now`` is seconds of the run's clock. Returns what is to be done, in order."""
        self.steps.losses.now = now
        if not self.over:
            self._handlers[type(event)](event)
        effects, self.robots.effects = self.robots.effects, []
        return effects

    def changes(self) -> list[Part | Member]:
        """Return, once, what has changed of members and parts since it was asked last."""
        touched, self.robots.touched = self.robots.touched, {}
        return list(touched.values())

    def _start(self, _event: Start) -> None:
        """Begin with the first step, once its places are the run's own."""
        if self.head.phase is Phase.NEW and self.program.occupies:
            self.steps.occupy()
        elif self.head.phase is Phase.NEW:
            self.steps.go_on()

    def _occupied(self, event: Occupied) -> None:
        """Begin, or note what the run waits for, or that it waited in vain."""
        if self.head.phase is not Phase.OCCUPYING:
            return
        if event.late:
            self.ending.fail(event.late, self._now)
        elif event.waits_for:
            self.head.waits_for = event.waits_for
            self.robots.note(f"The run waits for {event.waits_for}")
        else:
            self.head.waits_for = ""
            self.steps.go_on()

    def _facts(self, event: Facts) -> None:
        """Take what is seen of a robot; getting on gives it its time again."""
        before = self.seen.take(event)
        if before is None or before.progress == event.progress or not event.progress:
            return
        for part in self.robots.active("do", "undo", "abort", "secure"):
            if part.robot == event.robot:
                part.until = max(part.until, self._now + part.act.timeout)

    def _replied(self, event: Replied) -> None:
        """Take what became of a part."""
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
        elif event.outcome is not Outcome.DONE:
            self.steps.losses.lose(part.robot, event.outcome, event.reason)
        self.steps.look()

    def _left(self, event: Left) -> None:
        """Take note that a robot is not ours any more, and see whether the run can go on."""
        member = self.robots.members.get(event.robot)
        if member is None or not member.ours:
            return
        self.steps.losses.lose(event.robot, event.outcome, event.reason)
        self.ending.look(self._now)
        self.steps.look()

    def _stop_all(self, event: StopAll) -> None:
        """End the run; what is not stopped yet is held, nothing is undone."""
        for robot in event.robots:
            if robot in self.robots.members:
                self.robots.lose(robot, Outcome.STOPPED, event.reason, self._now)
        self.ending.stopped(event.reason, self._now)

    def _answer(self, event: Answer) -> None:
        """Take a person's answer; while the run is paused only to whether it may go on."""
        question = self.head.question
        if question is None or question.id != event.question or not self._decidable(question):
            return
        what = "continue" if event.goes_on else "abort"
        self.robots.note(f"{event.by or 'Somebody'} answered: {what}", step=self.steps.name)
        self._decide(question, what, event.by)

    def _decidable(self, question: Question) -> bool:
        """Return whether an answer, or its absence, is followed now: a paused run begins nothing."""
        return self.head.phase is not Phase.PAUSED or question.about == "resume"

    def _decide(self, question: Question, what: str, by: str) -> None:
        """Follow an answer, or its absence."""
        self.head.question = None
        if what == "abort":
            self.ending.abort(f"{question.text} abort" + (f" by {by}" if by else ""), self._now)
        elif what == "fail":
            self.steps.losses.fail(f"{question.text} no answer")
            self.steps.look()
        elif question.about == "resume":
            self.pausing.resume(Resume(by), confirmed=True)
        elif question.about == "robot":
            self.steps.again()
        else:
            self.steps.next()

    def _tick(self, _event: Tick) -> None:
        """See what time has brought."""
        head, deadline = self.head, self.program.deadline
        if deadline is not None and self._now >= deadline:
            self.ending.fail(f"the deadline of {deadline:g} s is over", self._now)
        question = head.question
        if question is not None and self._now >= question.until and self._decidable(question):
            self.robots.note(f"Nobody answered in time: {question.on_timeout}", step=self.steps.name)
            self._decide(question, question.on_timeout, "")
        self._time_out()
        self.steps.time_passes()
        self.ending.look(self._now)
        self.steps.look()

    def _time_out(self) -> None:
        """Give up what is late; while the run is paused nothing of the mission is."""
        for part in self.robots.active():
            paused = self.head.phase is Phase.PAUSED and part.kind == "do"
            if self._now < part.until or paused or not part.inflight:
                continue
            late = Outcome.UNKNOWN if part.kind == "halt" else Outcome.LATE
            reason = f"not seen done within {part.act.timeout:g} s; seen: {self.seen.words(part.robot)}"
            self.robots.end(part, late, reason, self._now)
            if part.kind == "do" and self.head.phase in GOING_ON:
                self.steps.losses.lose(part.robot, Outcome.LATE, reason)
            else:
                self.ending.ended(part, self._now)

    def _restarted(self, _event: Restarted) -> None:
        """Take up a run of an earlier process: what was under way is unknown, and is not begun again."""
        cut_off = self.robots.active()
        for part in cut_off:
            seen = self.seen.words(part.robot)
            reason = f"the edge restarted meanwhile; seen: {seen}"
            self.robots.end(part, Outcome.UNKNOWN, reason, self._now)
        self.robots.note("The edge restarted; what was under way is unknown", step=self.steps.name)
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
            self.pausing.go_on_between()
        elif self.head.question is None:
            self._pause_after_restart()

    def _ask_where_to_go_on(self) -> None:
        """Hold everybody, and ask: nobody knows how far the step came."""
        for member in self.robots.ours():
            self.robots.halt(self.steps.name, member.robot, self._now)
        self.head.phase = Phase.ASKING
        self.steps.losses.ask(
            f"The edge restarted in step {self.steps.name}. Go on with the next step?", "restart"
        )

    def _pause_after_restart(self) -> None:
        """Ask whether to go on where it was: nothing was under way."""
        self.pausing.begin()
        self.steps.losses.ask(f"The edge restarted before step {self.steps.name} was over. Go on?", "resume")
