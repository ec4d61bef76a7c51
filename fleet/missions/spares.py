"""Spares of one run: robots that replace a lost robot between two steps.

A spare qualified at the start, but does not belong to the run until it is needed. Then it is asked to join if
it still meets the requirements. If it does not join, the next spare is asked.
"""

from __future__ import annotations

from collections.abc import Iterator

from fleet.missions.facts import RobotFacts
from fleet.missions.program import Program
from fleet.missions.run_robots import RunRobots
from fleet.missions.state import Dismiss, Enlist, Enlisted, PartOutcome, Phase, RunHead, RunMember

ENLISTED_WITHIN = 10.0  # s for a spare to join the run


class Spares:
    """The spares of one run."""

    def __init__(self, program: Program, head: RunHead, robots: RunRobots, seen: RobotFacts) -> None:
        self._program = program
        self._head = head
        self._robots = robots
        self._seen = seen

    def request_spare(self, now: float) -> bool:
        """Ask the next spare to replace a lost robot; return True if the run waits for one."""
        for lost in self._lost():
            for spare in self._robots.spares(lost.role):
                lacks = self._seen.lacks(spare.robot, self._program.require)
                if lacks:
                    self._leave_out(spare, lacks, now)
                    continue
                self._head.phase, self._head.until = Phase.FILLING, now + ENLISTED_WITHIN
                self._head.enlists = spare.robot
                self._robots.note(f"is asked to take the place of {lost.robot}", spare.robot)
                self._robots.effects.append(Enlist(spare.robot))
                return True
        return False

    def handle(self, event: Enlisted, now: float) -> bool:
        """Handle a spare's answer; return True if the run continues, with or without it."""
        if self._head.phase is not Phase.FILLING or event.robot != self._head.enlists:
            if not event.refusal and not self._robots.members[event.robot].ours:
                self._robots.effects.append(Dismiss(event.robot))
            return False
        spare = self._robots.members[event.robot]
        lost = next((each for each in self._lost() if each.role == spare.role), None)
        if event.refusal or lost is None:
            self._leave_out(spare, event.refusal or "it is not needed", now)
            return True
        spare.spare, spare.ours, spare.within, spare.index, spare.plays = (
            False,
            True,
            True,
            lost.index,
            lost.plays,
        )
        lost.replaced = True
        for each in (spare, lost):
            self._robots.touched[f"member {each.robot}"] = each
        self._robots.note(f"takes the place of {lost.robot}", spare.robot)
        return True

    def _lost(self) -> Iterator[RunMember]:
        """Yield the lost robots that are not replaced yet."""
        for each in self._robots.members.values():
            if not each.within and not each.spare and not each.replaced:
                yield each

    def _leave_out(self, spare: RunMember, why: str, now: float) -> None:
        """Record that a spare cannot be used."""
        spare.spare, spare.replaced = False, True
        spare.outcome, spare.reason, spare.since = PartOutcome.REFUSED, why, now
        self._robots.touched[f"member {spare.robot}"] = spare
        self._robots.note(f"cannot take the place of another: {why}", spare.robot)
