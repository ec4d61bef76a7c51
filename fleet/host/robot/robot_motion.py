"""The motion of one robot that this edge causes: how it begins, how it ends, how the robot is stopped."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fleet.adapter import Adapter
from fleet.clock import Clock
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.event_reporter import Ask, EventReporter
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.attached_adapter import AttachedAdapter
from fleet.host.robot.executor import Executor
from fleet.host.robot.motion_guard import MotionGuard
from fleet.host.robot.navigator import Navigator
from fleet.host.robot.standstill import answer_stop, stand_still
from fleet.host.robot.velocity_control import VelocityControl
from fleet.model.report import NavigationReport


class RobotMotion:
    """Everything that moves one robot because of us.

    ``driving`` holds velocities and leads joints, ``executor`` runs commands, ``navigator`` runs actions.
    ``in_control``: the robot was moved through this edge, and nobody else has taken it since.
    ``may_be_moving``: it moved because of us when it was lost, and may still.
    """

    def __init__(
        self,
        attached: AttachedAdapter,
        guard: MotionGuard,
        driving: VelocityControl,
        event_reporter: EventReporter,
        *,
        publish: Callable[[NavigationReport], None],
        crashed: Callable[[Exception], None],
        clock: Clock,
        journal: RobotJournal,
    ) -> None:
        self.driving = driving
        self.executor = Executor(crashed=crashed, journal=journal, log=event_reporter.log)
        self.navigator = Navigator(
            publish=publish,
            hold=self.settle,
            crashed=crashed,
            clock=clock,
            journal=journal,
            ready=self.executor.standing,
        )
        self.in_control = False
        self.may_be_moving = journal.cut_off
        self._attached = attached
        self._guard = guard
        self._event_reporter = event_reporter
        self._crashed = crashed

    @property
    def activity(self) -> str:
        """What the robot is doing for somebody, in a word or two; empty when nothing."""
        return self.navigator.activity or self.executor.moving or self.driving.activity

    @property
    def under_way(self) -> bool:
        """True while the robot moves, or may move, because of us."""
        return bool(self.driving.activity or self.executor.moving or self.navigator.active)

    def begin(self, ask: Ask) -> None:
        """Note that the robot moves for a request from now on: it is ours."""
        self.in_control = True
        self._event_reporter.moves(ask)

    def end_driving(self, adapter: Adapter[Any]) -> None:
        """End a velocity that is held, or was until its lease ran out, before the robot moves otherwise."""
        self.driving.joints.end()
        if not self._guard.held.is_zero:
            self.driving.stand(adapter)

    def cancel(self, stop: str) -> None:
        """End what is under way, because of a stop of this name; ``stand`` follows."""
        self.executor.cancel(f"superseded by {stop}")
        self.navigator.cancel(f"stopped by {stop}")
        self.driving.let_go()

    def fail(self, why: str) -> None:
        """End what is under way, as failed; the robot itself is not stopped here."""
        self._event_reporter.ended()
        self.driving.let_go()
        self.executor.cancel(why)
        self.navigator.fail(why)

    def lost(self) -> None:
        """Note that the robot is out of reach: whether it may go on moving, since nothing can stop it now."""
        self.may_be_moving = (self.under_way or self.executor.stopping) and not self.executor.safe

    def found(self) -> None:
        """Stop a robot that was lost in motion and is back: it may be moving still."""
        if self.may_be_moving:
            self.may_be_moving = False
            self.settle_later("it was lost while it moved", anyway=True)

    def lease_ran_out(self) -> None:
        """Follow the watchdog's halt with the adapter's own zero velocity."""
        self._event_reporter.log.warning("no setpoint within its lease: stopped")
        adapter = self._attached.adapter
        if adapter is not None and not self.under_way:
            self.driving.stand(adapter)

    # -- to a standstill -----------------------------------------------------------------------------

    async def hold(self, why: str) -> None:
        """Bring the robot to a standstill in time, or halt it; raises CommandError, LinkError, a crash."""
        self.driving.let_go()
        adapter = self._attached.adapter
        if adapter is not None:
            await stand_still(adapter, why, name=self._attached.name, halt=self._attached.halt)

    def stand(self, why: str, receipt: Receipt) -> None:
        """Bring the robot to a standstill and answer once it stands; what is asked meanwhile waits."""
        self.executor.stop(self._hold_and_answer(why, receipt), why)

    async def _hold_and_answer(self, why: str, receipt: Receipt) -> None:
        """Bring the robot to a standstill, and answer."""

        def absence() -> str:  # as it is once the robot stands: an adapter says nothing of a lost link
            return self._attached.absence if self._attached.offline else ""

        await answer_stop(self.hold(why), receipt, absence=absence, crashed=self._crashed)

    def settle_later(self, why: str, *, anyway: bool = False) -> None:
        """Begin to ``settle``; what is asked meanwhile waits for its end."""
        self.executor.stop(self.settle(why, anyway=anyway), "stop")

    async def settle(self, why: str, *, anyway: bool = False) -> None:
        """Bring the robot to a standstill that nobody asked for, after something failed.

        One that is not ours is left alone, unless ``anyway``.
        """
        if anyway or self.in_control:
            self._event_reporter.log.warning("%s: it is brought to a standstill", why)
            await self._hold_and_answer(why, Receipt("stop", lambda _: None))
