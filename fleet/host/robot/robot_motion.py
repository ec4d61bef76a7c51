"""The motion of one robot that this edge causes: its start, its end, and bringing the robot to a stop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fleet.adapter import Adapter
from fleet.clock import Clock
from fleet.errors import CommandError, TimedOut
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.decode import RobotRequest
from fleet.host.requests.event_reporter import EventReporter
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.attached_adapter import AttachedAdapter
from fleet.host.robot.executor import Executor
from fleet.host.robot.motion_guard import MotionGuard
from fleet.host.robot.navigator import Navigator
from fleet.host.robot.standstill import answer_stop, stand_still
from fleet.host.robot.velocity_control import VelocityControl
from fleet.model.command import ReplyStatus, Setpoint
from fleet.model.report import NavigationReport


class RobotMotion:
    """Starts and ends all motion of one robot that this edge causes.

    ``driving`` holds velocities and joint targets, ``executor`` runs commands, ``navigator`` runs actions.
    ``in_control``: this edge moved the robot last, and has not lost control since.
    ``may_be_moving``: the robot was lost while this edge moved it, and may still move.
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
        self.executor = Executor(
            crashed=crashed, journal=journal, barred=driving.barred, log=event_reporter.log
        )
        self.navigator = Navigator(
            publish=publish,
            hold=self.settle_later,
            crashed=crashed,
            clock=clock,
            journal=journal,
            end=self.executor.end,
            ready=self.executor.ready,
        )
        self.in_control = self._had_control = False
        self.may_be_moving = journal.cut_off
        self._stop_unconfirmed = False  # a stop has begun, and no standstill was seen since
        self._attached = attached
        self._guard = guard
        self._event_reporter = event_reporter
        self._crashed = crashed
        self._journal = journal
        self.record()

    @property
    def activity(self) -> str:
        """The current activity in a word or two; empty when idle."""
        return self.navigator.activity or self.executor.moving or self.driving.activity

    @property
    def under_way(self) -> bool:
        """True while the robot moves, or may move, because of a request to this edge."""
        driving = self.driving
        held = driving.deadman.armed or driving.joints.deadman.armed
        return held or bool(self.executor.moving) or self.navigator.active

    def record(self) -> None:
        """Record whether the robot may be moving, for a process that follows this one; call it often."""
        moves = self.under_way or self.executor.stopping or self._stop_unconfirmed
        self._journal.moves(self.may_be_moving or (moves and not self.executor.safe))

    def begin(self, request: RobotRequest) -> None:
        """Note that a request moves the robot from now on: this edge is in control."""
        self._had_control, self.in_control = self.in_control, True
        self._stop_unconfirmed = (
            self._stop_unconfirmed and isinstance(request, Setpoint) and request.velocity.is_zero
        )
        self._event_reporter.moves(request)

    def not_begun(self, receipt: Receipt) -> None:
        """Note that the robot refused the last started request: control of it does not change."""
        if receipt.first is not None and receipt.first.status is ReplyStatus.DENIED:
            self.in_control = self.in_control and self._had_control

    def taken_over(self) -> None:
        """Note that another party controls the robot."""
        self.in_control = self.may_be_moving = self._stop_unconfirmed = False

    def end_driving(self, adapter: Adapter[Any]) -> None:
        """End a held velocity, also one whose lease has just expired, before another kind of motion."""
        self.driving.joints.end()
        if not self._guard.held.is_zero:
            self.driving.stand(adapter)

    def cancel(self, stop: str) -> None:
        """Cancel all running motion because of the stop of this name; ``stand`` follows."""
        self.executor.cancel(f"superseded by {stop}")
        self.navigator.cancel(f"stopped by {stop}")
        self.driving.release()

    def fail(self, why: str, *, halted: bool = False) -> None:
        """End all running motion as failed; the robot itself is not stopped here, but may be ``halted``."""
        if halted and self.under_way:
            self._stop_unconfirmed = True
        self._event_reporter.ended()
        self.driving.release()
        self.executor.cancel(why)
        self.navigator.fail(why)

    def lost(self) -> None:
        """Note that the robot is out of reach: whether it may go on moving, since nothing can stop it now."""
        moved = self.under_way or self.executor.stopping or self.driving.drove_lately
        moving = self._stop_unconfirmed or (self.in_control and moved)
        self.may_be_moving = moving and not self.executor.safe
        self.record()

    def found(self) -> None:
        """Stop a robot that is back after it was lost in motion: it may still be moving."""
        if self.may_be_moving:
            # Until it is seen to stand, it may be lost once more.
            self.may_be_moving, self._stop_unconfirmed = False, True
            self.settle_later("it was lost while it moved", anyway=True)

    def lease_ran_out(self) -> None:
        """Follow the watchdog's halt with the adapter's own zero velocity."""
        if self.driving.streamed:
            self._event_reporter.log.warning("no setpoint within its lease: stopped")
        else:
            self._event_reporter.log.info("the lease of a single velocity is over: stopped")
        adapter = self._attached.adapter
        if adapter is not None and self.in_control and not self.under_way:
            self.driving.stand(adapter)

    # -- to a standstill -----------------------------------------------------------------------------

    async def hold(self, why: str) -> None:
        """Stop the robot in time, or halt it; raises CommandError, LinkError, or what the adapter raised.

        One that is driven again before it was seen to stand is not halted.
        """
        self.driving.release()
        adapter = self._attached.adapter
        if adapter is None:
            return
        # A link that fails often fails the action or the stop first, and is lost only after that.
        self._stop_unconfirmed = True
        name = self._attached.name
        try:
            await stand_still(adapter, why, name=name, halt=self._halt_unless_driven)
        except CommandError:
            if self.driving.activity:
                raise TimedOut(f"{name} was driven again before it was seen to stand") from None
            raise
        self._stop_unconfirmed = False
        self.driving.seen_standing()

    async def hold_at_end(self, why: str, *, open_still: bool) -> None:
        """Stop the robot at the end of a run, whose link may be ``open_still``; never raises.

        One that was not seen to stand is stopped when it is back.
        """
        try:
            await self.hold(why)
        except Exception as error:  # noqa: BLE001 - the run is over; the halt has been written
            self._event_reporter.log.warning("it was not seen to stand as its run ended: %s", error)
        else:
            self.may_be_moving &= not open_still
        self.may_be_moving = self.may_be_moving or self._stop_unconfirmed
        self.record()

    def _halt_unless_driven(self) -> None:
        """Halt the robot after a stop that failed, unless a newer velocity or joint target moves it."""
        if not self.driving.activity:
            self._attached.halt()

    def stand(self, why: str, receipt: Receipt) -> None:
        """Stop the robot, and answer once it stands; later moving requests wait for that."""
        self.executor.stop(self._hold_and_answer(why, receipt), why, ended=self.record)

    async def _hold_and_answer(self, why: str, receipt: Receipt) -> None:
        """Stop the robot, and answer."""

        def absence() -> str:  # evaluated once the robot stands: adapters do not report a lost link
            return self._attached.unreachable_refusal if self._attached.offline else ""

        await answer_stop(self.hold(why), receipt, absence=absence, crashed=self._crashed)

    def settle_later(self, why: str, *, anyway: bool = False) -> None:
        """Begin to ``settle``; later moving requests wait for its end."""
        self.executor.stop(self.settle(why, anyway=anyway), "stop", ended=self.record)

    async def settle(self, why: str, *, anyway: bool = False) -> None:
        """Stop the robot by ourselves, after a failure; without control over it only with ``anyway``."""
        if anyway or self.in_control:
            self._event_reporter.log.warning("%s: it is brought to a standstill", why)
            await self._hold_and_answer(why, Receipt("stop", lambda _: None))
