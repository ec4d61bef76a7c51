"""Inner missions of one run: which are in progress, since when, and how a failed one is left."""

from __future__ import annotations

from fleet.missions.program import Enter, Leave, Program
from fleet.missions.run_robots import RunRobots
from fleet.missions.state import GOING_ON, Phase, RunHead

HELD = ("restart", "resume")
"""Questions whose answer decides whether the run continues: until then nothing else may advance it."""


class InnerMissions:
    """The inner missions of one run; ``head`` is the position of the run."""

    def __init__(self, program: Program, head: RunHead, robots: RunRobots) -> None:
        self._head = head
        self._robots = robots
        self._all = [(at, step) for at, step in enumerate(program.steps) if isinstance(step, Enter)]

    def under_way(self) -> list[tuple[int, Enter]]:
        """Return the missions in progress with the index of their Enter, outermost first."""
        return [(at, step) for at, step in self._all if at < self._head.at < step.end - 1]

    def enter(self, step: Enter, now: float) -> None:
        """Record the begin of a mission at the present index."""
        self._robots.note(f"The mission {step.mission} begins", step=step.id)
        self._head.entered[str(self._head.at)] = now

    def leave(self, step: Leave) -> None:
        """Record the completion of a mission, unless it failed and was left before."""
        if self._head.entered.pop(str(step.enter), None) is not None:
            name = next(each.mission for at, each in self._all if at == step.enter)
            self._robots.note(f"The mission {name} is completed", step=step.id)

    def late(self, now: float) -> tuple[int, Enter] | None:
        """Return a mission past its deadline; None while the run is paused or waits for a decision."""
        head = self._head
        if head.phase not in GOING_ON or head.phase is Phase.PAUSED or self._is_held():
            return None
        for at, step in self.under_way():
            began = head.entered.get(str(at), now)
            if step.deadline is not None and now - began >= step.deadline:
                return at, step
        return None

    def skip_to_end(self, at: int, inner: Enter) -> None:
        """Go to the end of a failed mission; its robots are made safe before the run continues."""
        head = self._head
        for index, _ in self.under_way():
            if index >= at:
                head.entered.pop(str(index), None)
        head.at = inner.end - 1
        head.serial += 1
        if self._is_held():
            head.paused_from = Phase.STEP
            return
        head.question = None
        if head.phase is Phase.PAUSED:
            head.paused_from = Phase.STEP
        else:
            head.phase = Phase.STEP

    def _is_held(self) -> bool:
        """Return True if a pending question decides whether the run continues."""
        return self._head.question is not None and self._head.question.about in HELD
