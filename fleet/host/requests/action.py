"""State machine of one action: six states, progress that never falls, exactly one terminal status."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from fleet.clock import Clock
from fleet.host.requests.remaining_distance import RemainingDistance
from fleet.model.navigation import NEXT, ActionState, AnyTask, FlyMission, FollowPath, FollowRobot, Progress
from fleet.model.report import NavigationReport

REPEAT = 0.5  # s; the shortest time between two progress statuses without a change


class Action:
    """One action. ``publish`` receives every status, ``ended`` the terminal one as well."""

    def __init__(
        self,
        action_id: str,
        task: AnyTask,
        *,
        publish: Callable[[NavigationReport], None],
        ended: Callable[[NavigationReport], None],
        clock: Clock,
    ) -> None:
        self.id = action_id
        self.task = task
        self.paused = False
        self.reached = 0
        self._publish = publish
        self._ended = ended
        self._clock = clock
        self._published_at = 0.0
        self._left = RemainingDistance()
        self.status = self._report(ActionState.QUEUED, 0.0, "")
        publish(self.status)

    @property
    def over(self) -> bool:
        """True once the terminal status is published."""
        return self.status.state.terminal

    @property
    def ahead(self) -> AnyTask:
        """Remaining part of its task, after a pause."""
        if isinstance(self.task, FlyMission):
            return msgspec.structs.replace(self.task, items=self.task.items[self.reached :])
        return self.task

    def pause(self) -> None:
        """Interrupt it; the task becomes its remaining part."""
        self.paused = True
        self._left.rest()
        if isinstance(self.task, FollowPath):
            left = (self.task.goals * self.task.loops)[max(0, self.reached) :]
            self.task = msgspec.structs.replace(self.task, goals=left or self.task.goals[-1:], loops=1)
            self.reached = 0
        elif isinstance(self.task, FlyMission):
            self.task = msgspec.structs.replace(self.task, resumed=True)
        self.move(ActionState.RUNNING, message="paused")

    def resume(self) -> None:
        """Continue after a pause."""
        self.paused = False
        self.move(ActionState.RUNNING, message="resumed")

    @property
    def words(self) -> str:
        """Short text for people: what the robot is doing."""
        doing, task = "navigating", self.task
        if isinstance(task, FollowRobot):
            return f"following {task.robot}" + (", paused" if self.paused else "")
        if isinstance(task, FlyMission):
            doing = f"mission, item {min(self.reached + 1, len(task.items))} of {len(task.items)},"
        return f"{doing} {self.status.progress:.0f} %" + (", paused" if self.paused else "")

    def progress(self, progress: Progress) -> None:
        """Report progress; statuses without a change are thinned out."""
        state = ActionState.BLOCKED if progress.blocked else ActionState.RUNNING
        percent = max(self.status.progress, min(99.0, progress.percent))
        self.reached = max(self.reached, progress.reached)
        self._left.update(progress.remaining, self._clock.monotonic())
        changed = state is not self.status.state or progress.message != self.status.message
        if changed or self._clock.monotonic() - self._published_at >= REPEAT:
            self.move(state, percent, progress.message)

    def complete(self) -> None:
        """Complete it. From blocked, the state table leads to completed only through running."""
        self.move(ActionState.COMPLETED)
        if not self.over:
            self.move(ActionState.RUNNING)
            self.move(ActionState.COMPLETED)

    def move(self, state: ActionState, percent: float | None = None, message: str = "") -> None:
        """Go to a state and publish it; a transition that is not in the state table is dropped."""
        before = self.status
        if state not in NEXT[before.state]:
            return
        if state is ActionState.COMPLETED:
            percent = 100.0
        self.status = self._report(state, before.progress if percent is None else percent, message)
        self._published_at = self._clock.monotonic()
        self._publish(self.status)
        if state.terminal:
            self._ended(self.status)

    def _report(self, state: ActionState, percent: float, message: str) -> NavigationReport:
        """Return a new status of this action."""
        left = RemainingDistance() if state.terminal else self._left
        now = self._clock.time()
        return NavigationReport(now, self.id, state, percent, message, self._step, left.metres, left.seconds)

    @property
    def _step(self) -> int | None:
        """Current item of a mission, None for any other task."""
        return min(self.reached, len(self.task.items) - 1) if isinstance(self.task, FlyMission) else None
