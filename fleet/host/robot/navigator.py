"""Runs the navigation actions of one robot, one at a time."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable

from fleet.clock import Clock
from fleet.errors import CommandError, LinkError
from fleet.host.follow.goal_follower import GoalNavigator
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.action import Action
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.action_statuses import ActionStatuses
from fleet.host.runtime.cancellation import closing, no_wait, was_cancelled
from fleet.model.navigation import ActionState, AnyTask, Control, Navigate, RelativeMove
from fleet.model.report import NavigationReport
from fleet.runtime.exception_barrier import error_text, failure_text, guarded

log = logging.getLogger(__name__)


class Navigator:
    """Navigation actions of one robot.

    ``hold`` begins to bring the robot to a standstill; ``crashed`` receives an unexpected error of the
    adapter; ``ready`` waits until the robot may begin, and raises Refused if it may not; ``end`` cancels a
    task. Each action is in the ``journal`` before it starts. ``statuses`` publishes and repeats the statuses
    of actions.
    """

    def __init__(
        self,
        *,
        publish: Callable[[NavigationReport], None],
        hold: Callable[[str], None],
        crashed: Callable[[Exception], None],
        clock: Clock,
        journal: RobotJournal,
        end: Callable[[asyncio.Task[None], str], None],
        ready: Callable[[], Awaitable[None]] = no_wait,
    ) -> None:
        self._ready = ready
        self._cancel = end
        self.statuses = ActionStatuses(publish, clock, journal)
        self._hold = hold
        self._crashed = crashed
        self._clock = clock
        self._work: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[None]] = set()  # includes tasks that are still being cancelled
        self._journal = journal
        self.action: Action | None = None
        self._requested = Navigate(Control.STOP)  # request for the present action

    @property
    def active(self) -> bool:
        """True while an action is running or paused."""
        return self.action is not None and not self.action.over

    def current_task(self) -> tuple[AnyTask, int] | None:
        """Return the running task and the number of goals already reached; None when there is none."""
        if self.action is None or self.action.over or self.action.paused:
            return None
        return self.action.task, self.action.reached

    @property
    def ahead(self) -> AnyTask | None:
        """Rest of the paused action; None when none is paused."""
        return self.action.ahead if self.active and self.action and self.action.paused else None

    @property
    def activity(self) -> str:
        """Short text about the action in progress; empty without one."""
        if self.action is None or self.action.over:
            return ""
        return self.action.words

    def start(self, who: GoalNavigator, request: Navigate, task: AnyTask, receipt: Receipt) -> None:
        """Start the ``task`` of a message with the navigator ``who``; a running action is cancelled."""
        self.cancel("superseded by a newer goal")
        self._requested = request
        self.action = Action(
            request.action_id,
            task,
            publish=self.statuses.publish,
            ended=lambda status: _answer(receipt, status),
            clock=self._clock,
        )
        self.statuses.remember(self.action.status, receipt)
        self._begin(who, self.action)

    def cancel(self, why: str) -> None:
        """End the action as ``cancelled``; this does not stop the robot."""
        self._end(ActionState.CANCELLED, why)

    def fail(self, why: str) -> None:
        """End the action as ``failed``; this does not stop the robot."""
        self._end(ActionState.FAILED, why)

    def pause(self) -> bool:
        """Interrupt the action; False when there is none."""
        if self.action is None or self.action.over:
            return False
        if isinstance(self.action.task, RelativeMove):
            self.cancel("a relative move cannot be paused: it would begin anew from another place")
            return True
        self._interrupt()
        self.action.pause()
        return True

    def resume(self, who: GoalNavigator) -> bool:
        """Continue a paused action; False when there is none."""
        if self.action is None or self.action.over or not self.action.paused:
            return False
        self.action.resume()
        self._begin(who, self.action)
        return True

    def _begin(self, who: GoalNavigator, action: Action) -> None:
        """Start the task of an action."""
        self._work = asyncio.create_task(self._run(who, action), name=f"action:{action.id}")
        self._tasks.add(self._work)
        self._work.add_done_callback(self._tasks.discard)

    def _end(self, state: ActionState, why: str) -> None:
        """Interrupt the work and publish the terminal status."""
        self._interrupt()
        if self.action is not None:
            self.action.move(state, message=why)
            self.action = None

    def _interrupt(self) -> None:
        """Cancel the work; it publishes nothing any more."""
        if self._work is not None:
            self._cancel(self._work, "the action was ended")
            self._work = None

    async def _run(self, who: GoalNavigator, action: Action) -> None:
        """Run the navigator's iteration and turn its end into the terminal status."""
        action.move(ActionState.RUNNING)
        try:
            transport = (
                self._requested.origin.transport if self._requested.is_command else ""
            )  # others only get a status
            self._journal.note(action.id, self._requested.name, action=True, transport=transport)
            await self._ready()
            await guarded(lambda: self._follow(who, action))
            if self._is_current():
                action.complete()
        except (CommandError, LinkError) as error:
            self._fail(action, error_text(error))
        except asyncio.CancelledError:
            if was_cancelled():
                raise
            self._fail(action, "the adapter cancelled it")
        except Exception as error:
            log.exception("the adapter failed in navigate")
            if self._is_current():
                action.move(ActionState.FAILED, message=failure_text(error))
            self._crashed(error)

    def _is_current(self) -> bool:
        """Return False for work that goes on despite its cancellation: it has no effect any more."""
        return self._work is asyncio.current_task()

    async def _follow(self, who: GoalNavigator, action: Action) -> None:
        """Publish the navigator's progress until the action is cancelled."""
        async with closing(who.navigate(action.task)) as steps:
            async for progress in steps:
                if not self._is_current():
                    return
                action.progress(progress)

    def _fail(self, action: Action, why: str) -> None:
        """Report that the work failed, and hold the robot."""
        if self._is_current():
            action.move(ActionState.FAILED, message=why)
            self._hold(f"navigation failed: {why}")


def _answer(receipt: Receipt, status: NavigationReport) -> None:
    """Give the end of an action to a sender that waits for it."""
    if status.state is ActionState.COMPLETED:
        receipt.done()
    else:
        cancelled = f"{status.state.value}: " if status.state is ActionState.CANCELLED else ""
        receipt.reject(f"{cancelled}{status.message}")
