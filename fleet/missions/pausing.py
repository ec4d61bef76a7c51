"""Pauses and resumes one mission run."""

from __future__ import annotations

import msgspec

from fleet.missions.facts import RobotFacts
from fleet.missions.program import Program
from fleet.missions.run_robots import RunRobots
from fleet.missions.state import Hold, Occupy, Pause, Phase, Resume, RunHead, required
from fleet.missions.steps import StepRunner

PAUSABLE = frozenset({"goto", "path", "plan", "follow"})
"""Commands that move a robot along a route and can be paused; any other command ends by itself."""


class Pausing:
    """Pauses and resumes one mission run."""

    def __init__(
        self, program: Program, head: RunHead, robots: RunRobots, seen: RobotFacts, steps: StepRunner
    ) -> None:
        self._program = program
        self._head = head
        self._robots = robots
        self._seen = seen
        self._steps = steps

    @property
    def _now(self) -> float:
        """The time of the current event."""
        return self._steps.losses.now

    def pause(self, event: Pause) -> None:
        """Pause the run and record the robots' positions.

        A robot that cannot continue pauses the whole run.
        """
        head = self._head
        if event.robot:
            self._robots.note(event.reason, event.robot, self._steps.name)
        if head.phase not in (Phase.STEP, Phase.WAITING, Phase.ASKING):
            return
        self.begin()
        why = f"The run stays paused for {event.robot}" if event.robot else ""
        self._robots.note(why or f"{event.by or 'Somebody'} paused the run", step=self._steps.name)
        for member in self._robots.within():
            member.paused_at = self._seen.position(member.robot)
            self._robots.touched[f"member {member.robot}"] = member
        self._hold(resumes=False, without=event.robot)

    def begin(self) -> None:
        """Enter the paused phase, unless the run is paused already."""
        head = self._head
        if head.phase is not Phase.PAUSED:
            head.paused_from, head.paused_at, head.phase = head.phase, self._now, Phase.PAUSED

    def resume(self, event: Resume, *, confirmed: bool = False) -> None:
        """Resume a paused run, or ask a person first if something has changed since."""
        head = self._head
        if head.phase is not Phase.PAUSED:
            return
        question = head.question if head.question is not None and head.question.about != "resume" else None
        trouble = "" if confirmed or question is not None else self._change()
        if trouble:
            self._steps.losses.ask(f"{trouble}. Resume anyway?", "resume")
            return
        head.phase, paused = head.paused_from, self._now - head.paused_at
        head.until += paused
        head.question = question and msgspec.structs.replace(question, until=question.until + paused)
        for part in self._robots.active():
            part.until += paused
            self._robots.touched[part.identity] = part
        self._robots.note(f"{event.by or 'Somebody'} resumed the run", step=self._steps.name)
        self._hold(resumes=True)
        self.continue_between_steps()
        self._steps.check()

    def continue_between_steps(self) -> None:
        """Continue between two steps, or before the first."""
        if self._head.phase is Phase.OCCUPYING:
            self._robots.effects.append(Occupy())
        elif self._head.phase in (Phase.NEW, Phase.FILLING, Phase.PREPARING):
            self._steps.run_until_wait()

    def _hold(self, *, resumes: bool, without: str = "") -> None:
        """Pause or resume the pausable commands."""
        for part in self._robots.active("do"):
            if part.act.verb in PAUSABLE and part.robot != without:
                self._robots.effects.append(Hold(part, resumes))

    def _change(self) -> str:
        """Return what has changed since the pause; empty if nothing has."""
        for member in self._robots.within():
            trouble = self._seen.lacks(member.robot, required(self._program, self._head))
            trouble = trouble or self._seen.moved(member.robot, member.paused_at)
            if trouble:
                return f"{member.robot}: {trouble}"
        return ""
