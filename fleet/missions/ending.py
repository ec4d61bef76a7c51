"""The end of a run: failure, abort, undo. Its robots are held first; steps are undone in reverse order."""

from __future__ import annotations

from fleet.missions.program import Act, Do, Program
from fleet.missions.run_robots import RunRobots
from fleet.missions.state import (
    GOING_ON,
    NEXT,
    EmergencyStop,
    Ended,
    PartOutcome,
    Phase,
    RunHead,
    RunOutcome,
    StepPart,
    UndoableStep,
    step_name,
)

ON_ABORT_WITHIN = 300.0  # s for the on_abort command; progress extends it


class Ending:
    """Brings one run to its terminal state. Phases only go forward: see ``state.NEXT``."""

    def __init__(self, program: Program, head: RunHead, robots: RunRobots) -> None:
        self._program = program
        self._head = head
        self._robots = robots

    def fail(self, reason: str, now: float, *, undoes: bool = True) -> None:
        """End the run as failed, as the mission defines it."""
        if self._head.phase not in GOING_ON:
            return
        self._leave_off(RunOutcome.FAILED, reason, now)
        if self._program.on_failure == "stop":
            robots = tuple(member.robot for member in self._robots.ours())
            if robots:
                self._robots.effects.append(EmergencyStop(robots, reason))
            for robot in robots:
                self._robots.lose(robot, PartOutcome.STOPPED, reason, now)
        else:
            self._halt_all(now)
        undo = undoes and self._program.on_failure == "undo"
        self._enter(Phase.HALTING if undo else Phase.ENDING)
        self.check(now)

    def abort(self, reason: str, now: float) -> None:
        """End the run at a person's request, as the mission defines it."""
        if self._head.phase not in GOING_ON:
            return
        self._leave_off(RunOutcome.ABORTED, reason, now)
        self._enter(Phase.ENDING)
        if self._program.on_abort == "hold":
            self._halt_all(now)
        else:
            act = Act("command", self._program.on_abort, timeout=ON_ABORT_WITHIN)
            for member in self._robots.ours():
                if not self._robots.comes_down(member.robot):
                    self._robots.begin(self._step, member.robot, act, "abort", now)
        self.check(now)

    def stopped(self, reason: str, now: float) -> None:
        """End the run after an emergency stop of several of its robots; hold the others."""
        self._leave_off(RunOutcome.ABORTED, f"emergency stop: {reason}", now)
        for part in self._robots.active("undo", "abort", "secure"):
            if not self._robots.comes_down(part.robot):
                self._robots.end(part, PartOutcome.SKIPPED, "the run was stopped", now)
        self._enter(Phase.ENDING)
        self._halt_all(now)
        self.check(now)

    def restarted(self, now: float) -> None:
        """Continue an end that a restart interrupted: hold all robots; the result of an undo is unknown."""
        if self._head.phase in (Phase.HALTING, Phase.UNDOING):
            self._head.target = RunOutcome.UNDO_FAILED
            self._head.reason += "; the edge restarted while it was undone"
        self._enter(Phase.ENDING)
        self._halt_all(now)
        self.check(now)

    def ended(self, part: StepPart, now: float) -> None:
        """Handle the end of a part during the ending."""
        if part.kind == "undo" and part.outcome is not PartOutcome.DONE and self._head.phase is Phase.UNDOING:
            self._head.target = RunOutcome.UNDO_FAILED
            self._head.reason += f"; {part.robot} could not undo {part.step}: {part.reason}"
            for each in self._robots.active("undo"):
                if not self._robots.comes_down(each.robot):
                    self._robots.end(each, PartOutcome.SKIPPED, "the undo of another robot failed", now)
            self._halt_all(now)
            self._enter(Phase.ENDING)
        elif part.kind in ("abort", "secure", "do") and part.outcome is not PartOutcome.DONE:
            self._robots.halt(part.step, part.robot, now)
        elif part.kind == "halt" and part.outcome is not PartOutcome.DONE and self._head.target is not None:
            self._head.reason += f"; {part.robot} was not seen to stand still: {part.reason}"
        self.check(now)

    def check(self, now: float) -> None:
        """Continue when all active parts have ended."""
        if self._head.phase in GOING_ON or self._head.phase is Phase.ENDED or self._robots.active():
            return
        if self._head.phase is Phase.ENDING:
            self.close(self._head.target or RunOutcome.UNKNOWN, self._head.reason)
            return
        if self._head.phase is Phase.HALTING and self._all_stopped():
            self.stopped(self._head.reason, now)  # seen robot by robot, before the stop of all was heard
            return
        self._enter(Phase.UNDOING)
        while self._head.undoable and not self._robots.active():
            self._undo(self._head.undoable.pop(), now)
        if not self._robots.active():
            self.close(RunOutcome.UNDONE, self._head.reason)

    def _all_stopped(self) -> bool:
        """Return whether an emergency stop took every robot out of the run: nobody is left to undo a step."""
        members = self._robots.members.values()
        return bool(members) and all(each.outcome is PartOutcome.STOPPED for each in members)

    def close(self, outcome: RunOutcome, reason: str) -> None:
        """Enter the terminal state."""
        if self._head.phase is Phase.ENDED:
            return
        for part in self._robots.active():
            self._robots.end(part, PartOutcome.UNKNOWN, "the run ended", part.began)
        for member in self._robots.within():
            unseen = _unseen(self._robots, member.robot)
            if not outcome.value.startswith("completed"):
                member.outcome = PartOutcome.SKIPPED
            elif not unseen:
                member.outcome = PartOutcome.DONE
            else:  # the run continued at a person's word, without knowledge of the robot
                member.outcome, member.reason = (
                    PartOutcome.UNKNOWN,
                    f"the end of step {unseen} was not observed",
                )
                outcome = RunOutcome.WITH_LOSSES
            self._robots.touched[f"member {member.robot}"] = member
        self._head.question = None
        self._head.outcome, self._head.reason = outcome, reason
        self._enter(Phase.ENDED)
        self._robots.note(
            f"The run has ended: {outcome.replace('_', ' ')}" + (f": {reason}" if reason else "")
        )
        self._robots.effects.append(Ended(outcome, reason))

    def _undo(self, undoable: UndoableStep, now: float) -> None:
        """Undo one step for the robots that are still ours and had started it."""
        step = self._program.steps[undoable.at]
        if not isinstance(step, Do) or not step.undo:
            return
        started = {part.robot for part in self._robots.parts_of(undoable.step)}
        for member in self._robots.ours():
            act = self._robots.act_of(member, step.undo)
            if act is not None and member.robot in started:
                self._robots.begin(undoable.step, member.robot, act, "undo", now)

    def _leave_off(self, target: RunOutcome, reason: str, now: float) -> None:
        """End the parts of the mission."""
        self._head.target, self._head.reason, self._head.question = target, reason, None
        self._robots.note(f"The run is to end as {target}: {reason}", step=self._step)
        for part in self._robots.active("do"):
            if not self._robots.comes_down(part.robot):
                self._robots.end(part, PartOutcome.SKIPPED, "the run left off", now)

    def _halt_all(self, now: float) -> None:
        """Halt every robot of ours, except those that are being made safe."""
        secured = {part.robot for part in self._robots.active("secure")}
        for member in self._robots.ours():
            if member.robot not in secured:
                self._robots.halt(self._step, member.robot, now)

    def _enter(self, phase: Phase) -> None:
        """Enter a phase if the table permits it; earlier phases are never entered again."""
        if phase in NEXT[self._head.phase]:
            self._head.phase = phase

    @property
    def _step(self) -> str:
        """The present step."""
        return step_name(self._program, self._head)


def _unseen(robots: RunRobots, robot: str) -> str:
    """Return a robot's last step if its outcome is unknown; else empty."""
    parts = [part for part in robots.parts.values() if part.robot == robot and part.kind == "do"]
    newest = max(parts, key=lambda part: part.began, default=None)
    return newest.step if newest is not None and newest.outcome is PartOutcome.UNKNOWN else ""
