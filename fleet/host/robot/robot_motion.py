"""Motion of one robot that this edge causes: its start, its end, and the stop of the robot."""

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
    """All motion of one robot that this edge causes.

    ``driving`` holds velocities and joint targets, ``executor`` runs commands, ``navigator`` runs actions.
    ``in_control``: this edge has moved the robot, and no other party has taken it since.
    ``may_be_moving``: this edge moved it when it was lost, and it may still be moving.
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
        self._stop_unconfirmed = False  # a stop has begun, and no standstill was seen since
        self._attached = attached
        self._guard = guard
        self._event_reporter = event_reporter
        self._crashed = crashed

    @property
    def activity(self) -> str:
        """Short text about the robot's activity; empty without any."""
        return self.navigator.activity or self.executor.moving or self.driving.activity

    @property
    def under_way(self) -> bool:
        """True while the robot moves, or may move, because of this edge."""
        return bool(self.driving.activity or self.executor.moving or self.navigator.active)

    def begin(self, ask: Ask) -> None:
        """Record the request for which the robot moves from now on; it is under our control."""
        self.in_control, self._stop_unconfirmed = True, False
        self._event_reporter.moves(ask)

    def end_driving(self, adapter: Adapter[Any]) -> None:
        """End a velocity, or the rest of one with an expired lease, before the robot moves in another way."""
        self.driving.joints.end()
        if not self._guard.held.is_zero:
            self.driving.stand(adapter)

    def cancel(self, stop: str) -> None:
        """Cancel all motion because of this stop; ``stand`` follows."""
        self.executor.cancel(f"superseded by {stop}")
        self.navigator.cancel(f"stopped by {stop}")
        self.driving.let_go()

    def fail(self, why: str) -> None:
        """End all motion as failed; this does not stop the robot itself."""
        self._event_reporter.ended()
        self.driving.let_go()
        self.executor.cancel(why)
        self.navigator.fail(why)

    def lost(self) -> None:
        """Record whether the robot may keep moving while it is out of reach, where nothing can stop it."""
        moving = self.under_way or self.executor.stopping or self._stop_unconfirmed
        self.may_be_moving = moving and not self.executor.safe

    def found(self) -> None:
        """Stop a robot that was lost in motion and is back: it may still be moving."""
        if self.may_be_moving:
            self.may_be_moving = False
            self.settle_later("it was lost while it moved", anyway=True)

    def lease_ran_out(self) -> None:
        """Follow the watchdog's halt with the adapter's own zero velocity."""
        self._event_reporter.log.warning("no setpoint within its lease: stopped")
        adapter = self._attached.adapter
        if adapter is not None and not self.under_way:
            self.driving.stand(adapter)

    # -- standstill ----------------------------------------------------------------------------------

    async def hold(self, why: str) -> None:
        """Bring the robot to a standstill in time, or halt it; raises CommandError, LinkError, a crash."""
        self.driving.let_go()
        adapter = self._attached.adapter
        if adapter is None:
            return
        # A link that fails often fails the action or the stop first, and is lost only after that.
        self._stop_unconfirmed = True
        await stand_still(adapter, why, name=self._attached.name, halt=self._attached.halt)
        self._stop_unconfirmed = False

    def stand(self, why: str, receipt: Receipt) -> None:
        """Bring the robot to a standstill, then answer; later moving requests wait for that."""
        self.executor.stop(self._hold_and_answer(why, receipt), why)

    async def _hold_and_answer(self, why: str, receipt: Receipt) -> None:
        """Bring the robot to a standstill, and answer."""

        def absence() -> str:  # evaluated at standstill: adapters do not report a lost link
            return self._attached.absence if self._attached.offline else ""

        await answer_stop(self.hold(why), receipt, absence=absence, crashed=self._crashed)

    def settle_later(self, why: str, *, anyway: bool = False) -> None:
        """Start ``settle`` as a stop; later moving requests wait for its end."""
        self.executor.stop(self.settle(why, anyway=anyway), "stop")

    async def settle(self, why: str, *, anyway: bool = False) -> None:
        """Bring the robot to a standstill after a failure, without a request.

        A robot that is not under our control is left alone, unless ``anyway``.
        """
        if anyway or self.in_control:
            self._event_reporter.log.warning("%s: it is brought to a standstill", why)
            await self._hold_and_answer(why, Receipt("stop", lambda _: None))
