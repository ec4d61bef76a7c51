"""Runs the navigation actions of one robot, one at a time."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

from fleet.adapter import Adapter
from fleet.clock import Clock
from fleet.errors import CommandError, LinkError
from fleet.host.actions import Action
from fleet.host.follow.leader import Leader
from fleet.host.make import Capabilities
from fleet.host.ticket import Ticket
from fleet.model.navigation import ActionState, Progress, RelativeMove, Task
from fleet.model.report import NavigationReport

log = logging.getLogger(__name__)

Way = Callable[[Task], AsyncIterator[Progress]]
"""Carries out a task: the adapter's own ``navigate``, or the host's follower."""

KEPT = 64  # finished actions remembered, to answer a repeated action id with its last status


class Navigator:
    """The actions of one robot.

    ``hold`` brings the robot to a standstill; ``crashed`` hears of an adapter that raised what it may not.
    """

    def __init__(
        self,
        *,
        publish: Callable[[NavigationReport], None],
        hold: Callable[[str], Awaitable[None]],
        crashed: Callable[[Exception], None],
        clock: Clock,
    ) -> None:
        self._publish = publish
        self._hold = hold
        self._crashed = crashed
        self._clock = clock
        self._work: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[None]] = set()  # also those that are still being cancelled
        self._known: dict[str, Action] = {}
        self.action: Action | None = None

    @property
    def active(self) -> bool:
        """True while an action is running or paused."""
        return self.action is not None and not self.action.over

    def repeated(self, action_id: str) -> bool:
        """Say the last status again for an action id that was seen before; False for a new one."""
        known = self._known.get(action_id)
        if known is None:
            return False
        self._publish(known.status)
        return True

    def start(self, way: Way, task: Task, action_id: str, ticket: Ticket) -> None:
        """Begin a task by whoever leads the robot; whatever was under way is cancelled."""
        self.cancel("superseded by a newer goal")
        self.action = Action(
            action_id,
            task,
            publish=self._publish,
            ended=lambda status: _answer(ticket, status),
            clock=self._clock,
        )
        self._remember(self.action)
        self._begin(way, self.action)

    def refuse(self, action_id: str, reason: str) -> None:
        """Say that an action failed before it began."""
        self._publish(NavigationReport(self._clock.time(), action_id, ActionState.FAILED, 0.0, reason))

    def completed(self, action_id: str) -> None:
        """Say that a control message that carries an action id of its own has been obeyed."""
        if action_id:
            self._publish(NavigationReport(self._clock.time(), action_id, ActionState.COMPLETED, 100.0))

    def cancel(self, why: str) -> None:
        """End what is under way with ``cancelled``; the robot is not stopped here."""
        self._end(ActionState.CANCELLED, why)

    def fail(self, why: str) -> None:
        """End what is under way with ``failed``; the robot is not stopped here."""
        self._end(ActionState.FAILED, why)

    def pause(self) -> bool:
        """Interrupt what is under way; False when there is nothing."""
        if self.action is None or self.action.over:
            return False
        if isinstance(self.action.task, RelativeMove):
            self.cancel("a relative move cannot be paused: it would begin anew from another place")
            return True
        self._interrupt()
        self.action.pause()
        return True

    def resume(self, way: Way) -> bool:
        """Go on with what was paused; False when nothing was."""
        if self.action is None or self.action.over or not self.action.paused:
            return False
        self.action.resume()
        self._begin(way, self.action)
        return True

    def _begin(self, way: Way, action: Action) -> None:
        """Run the task of an action."""
        self._work = asyncio.create_task(self._run(way, action), name=f"action:{action.id}")
        self._tasks.add(self._work)
        self._work.add_done_callback(self._tasks.discard)

    def _end(self, state: ActionState, why: str) -> None:
        """Interrupt the work and say the terminal status."""
        self._interrupt()
        if self.action is not None:
            self.action.move(state, message=why)
            self.action = None

    def _interrupt(self) -> None:
        """Cancel the work, which then says nothing more."""
        if self._work is not None:
            self._work.cancel()
            self._work = None

    async def _run(self, way: Way, action: Action) -> None:
        """Drive the iteration of who leads and turn its end into the terminal status."""
        action.move(ActionState.RUNNING)
        try:
            async for progress in way(action.task):
                action.progress(progress)
            action.move(ActionState.COMPLETED)
        except (CommandError, LinkError) as error:
            action.move(ActionState.FAILED, message=str(error))
            await self._hold(f"navigation failed: {error}")
        except Exception as error:
            log.exception("the adapter failed in navigate")
            action.move(ActionState.FAILED, message=f"{type(error).__name__}: {error}")
            self._crashed(error)

    def _remember(self, action: Action) -> None:
        """Keep an action for repeats of its id."""
        if not action.id:
            return
        self._known[action.id] = action
        while len(self._known) > KEPT:
            del self._known[next(iter(self._known))]


def way_of(adapter: Adapter[Any] | None, can: Capabilities, leader: Leader) -> Way | None:
    """Return who leads a robot to a goal: itself, or the host's follower; None when neither can."""
    if adapter is not None and can.navigates:
        return adapter.navigate
    return leader.navigate if adapter is not None and can.drives and leader.has_pose else None


def cannot_navigate(name: str, can: Capabilities) -> str:
    """Return why nobody can lead a robot to a goal."""
    return f"{name} does not navigate: " + (
        "it has not told where it is" if can.drives else "it takes no velocities"
    )


def _answer(ticket: Ticket, status: NavigationReport) -> None:
    """Tell whoever waits for an action how it ended."""
    if status.state is ActionState.COMPLETED:
        ticket.done()
    else:
        ticket.reject(f"{status.state.value}: {status.message}")
