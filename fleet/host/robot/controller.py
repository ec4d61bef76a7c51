"""The controller of one robot: every request to it takes the same path through here.

A decoded request passes admission (who, how old, whose turn), then the adapter; what was observed is its
answer. Runs on the event loop, except ``emergency`` and ``halt``, which any thread may call.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from fleet.adapter import Adapter
from fleet.clock import Clock
from fleet.commands import CommandSpec
from fleet.errors import Refused
from fleet.host.follow.goal_follower import LEASE, GoalNavigator, goal_follower_of, goal_navigator
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.event_reporter import Ask, EventReporter
from fleet.host.requests.last_command import LastCommand
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.adapter_factory import Capabilities
from fleet.host.robot.executor import Executor, may_still_move, takes
from fleet.host.robot.motion_guard import MotionGuard
from fleet.host.robot.navigator import Navigator
from fleet.host.robot.own_commands import MOTION, own_commands
from fleet.host.robot.run_commands import run_commands
from fleet.host.robot.standstill import answer_stop, stand_still, what_was_written, write_halt
from fleet.host.robot.velocity_control import VelocityControl
from fleet.host.runtime.threads import HALT_WAIT, run_in_thread, run_in_turn
from fleet.host.safety.admission import Admission
from fleet.host.safety.emergency_stop import EmergencyStopLatch
from fleet.host.safety.verb_speeds import VerbSpeeds
from fleet.model.command import Command, JointSetpoint, Setpoint
from fleet.model.geometry import Velocity
from fleet.model.navigation import AnyTask, Control, Navigate
from fleet.model.report import Report
from fleet.robot_config import AdapterConfig
from fleet.wire.stops import EMERGENCY, STOP_WORDS


class RobotController:
    """Admits, executes and answers the requests to one robot.

    ``publish`` takes reports; ``crashed`` hears of an adapter's crash; ``restart`` begins its run anew;
    ``journal`` knows what was asked before this process began.
    """

    def __init__(
        self,
        config: AdapterConfig,
        capabilities: Capabilities,
        *,
        publish: Callable[[Report], None],
        crashed: Callable[[Exception], None],
        restart: Callable[[], None],
        journal: RobotJournal,
        clock: Clock,
    ) -> None:
        self.name, self.last, self.can = config.name, LastCommand(), capabilities
        limits, combines = config.limits.over(capabilities.limits), capabilities.combines_keys
        self.event_reporter = EventReporter(self.name, publish, clock, in_motion=lambda: self.in_motion)
        self.guard = MotionGuard(config, limits, clock, robot=self, event_reporter=self.event_reporter)
        self._crashed, self._clock, self._journal, self.speeds = crashed, clock, journal, VerbSpeeds(limits)
        latch = EmergencyStopLatch(journal.latched, journal.latch)
        self._admission = Admission(config, clock, latch, self.speeds)
        self.permit = self._admission.permit
        life, barred, guard = config.setpoint_lease, self._admission.motion, self.guard
        self._driving = VelocityControl(
            limits, clock, life, guard, combines=combines, barred=barred, halt=self.halt, crashed=crashed
        )
        self.deadman, self.joints = self._driving.deadman, self._driving.joints
        self.senders, self.latch, self.lease = self._admission.offsets, latch, self._admission.lease
        self.would_refuse, self._repeats = self._admission.would_refuse, journal.repeats(clock.monotonic())
        release, store, drives = self.latch.release, self.speeds.store, capabilities.drives
        follow = self.joints.follow if config.follows and capabilities.moves_joints else None
        self.own = own_commands(release=release, restart=restart, store=store, drives=drives, follow=follow)
        self.own |= run_commands(self._admission, self._stop)
        self._adapter: Adapter[Any] | None = None
        self.offline = "it has not been reached yet"  # why it cannot be asked; empty while it can
        self.in_control = self._heard = False  # _heard: since the adapter's run began
        self.may_be_moving = journal.cut_off  # it moved because of us when it was lost, and may still
        self._executor = Executor(crashed=crashed, journal=journal, log=self.event_reporter.log)
        ready, any_way = self._executor.standing, lambda: self.can.moves_any_way
        self._navigator = Navigator(
            publish=publish, hold=self._settle, crashed=crashed, clock=clock, journal=journal, ready=ready
        )
        self.doing, self.statuses = self._navigator.doing, self._navigator.statuses
        self._leader = goal_follower_of(config, self._lead, limits, clock, guard.others.of, holonomic=any_way)
        self.see, self.hold_again = self._leader.see, self._driving.hold_again  # see: the poses it is led by
        self.configured = (self._admission, self.speeds, self.guard, self._driving, self._leader)

    @property
    def latched(self) -> bool:
        """True while an emergency stop is set."""
        return self.latch.set

    @property
    def activity(self) -> str:
        """What the robot is doing for somebody, in a word or two; empty when nothing."""
        if self.latched:
            return "emergency stop"
        return self._navigator.activity or self._executor.moving or self._driving.activity

    @property
    def in_motion(self) -> bool:
        """True while the robot moves, or may move, because of us."""
        return bool(self._driving.activity or self._executor.moving or self._navigator.active)

    @property
    def free(self) -> bool:
        """True when the host may act by itself: it is ours, not latched, and nothing safer is under way."""
        return self.in_control and not (self.latched or self._executor.safe)

    def attach(self, adapter: Adapter[Any]) -> None:
        """Take the adapter of a fresh run; it is asked nothing but to stop until ``found``."""
        self._adapter, self._heard = adapter, False
        self.joints.attach(adapter)

    def found(self) -> None:
        """Note that the robot answers: it can be asked from now on."""
        self.offline, self._admission.fault, self._heard = "", "", True
        self._catch()

    def _catch(self) -> None:
        """Stop a robot that was lost while it moved, and is back: it may still be at it."""
        if self.may_be_moving:
            self.may_be_moving = False
            self._executor.stop(self._settle("it was lost while it moved", anyway=True), "stop")

    def faulted(self, why: str) -> None:
        """Note a fault of a robot that answers: it moves no more until ``found``; a landing goes on."""
        before, self._admission.fault, self.offline, self._heard = self._admission.fault, why, "", True
        self._catch()
        if before or self._executor.safe:
            return
        if self.in_control:
            self.halt()
        self._end_motion(why)

    def lost(self, why: str) -> None:
        """Note that the robot does not answer; what was under way has failed and is never taken up again.

        A robot that somebody else moves is not touched.
        """
        if not self.offline and self.in_control:
            self.may_be_moving = (self.in_motion or self._executor.stopping) and not self._executor.safe
            self.halt()
        self.offline, self._admission.fault = why, ""
        self._end_motion(why)

    def detach(self, why: str) -> None:
        """Take the adapter away."""
        self.lost(why)
        self._admission.taken_over(f"lost: {why}")
        self.joints.forget()
        self._adapter, self.in_control = None, False

    def authority_lost(self, reason: str) -> None:
        """Somebody else took the robot: nothing of ours goes on, and a new command is needed."""
        self.event_reporter.authority_lost(reason)
        self._end_motion(f"authority lost: {reason}")
        self._admission.taken_over(f"taken: authority lost: {reason}")
        self.in_control, self.may_be_moving, self.guard.taken = False, False, True

    def _end_motion(self, why: str) -> None:
        """End what is under way."""
        self.event_reporter.ended()
        self._driving.let_go()
        self._executor.cancel(why)
        self._navigator.fail(why)

    def end(self, why: str) -> None:
        """End motion of ours that must not go on, for this reason; a landing or a way home goes on."""
        if self.free and self.in_motion:
            self._end_motion(why)
            self._executor.stop(self._settle(why), "stop")

    def emergency(self, why: str) -> None:
        """Latch, write the emergency halt, record; the last two may hang; any thread. ``receive`` follows."""
        self.latch.engage(why)
        run_in_turn((partial(self.halt, emergency=True), self.latch.record), wait=HALT_WAIT)

    def halt(self, *, emergency: bool = False) -> None:
        """Write the halt at once; from any thread (the watchdog's); never raises."""
        write_halt(self._adapter, self.name, emergency=emergency)

    def lease_ran_out(self) -> None:
        """Follow the watchdog's halt with the adapter's own zero velocity."""
        self.event_reporter.log.warning("no setpoint within its lease: stopped")
        if self._adapter is not None and not self.in_motion:
            self._driving.stand(self._adapter)

    async def hold(self, why: str) -> None:
        """Bring the robot to a standstill in time, or halt it; raises CommandError, LinkError, a crash."""
        self._driving.let_go()
        if self._adapter is not None:
            await stand_still(self._adapter, why, name=self.name, halt=self.halt)

    def receive(self, ask: Ask, receipt: Receipt) -> None:
        """Take a request; its receipt is answered exactly once."""
        if isinstance(ask, Setpoint):
            self._setpoint(ask, receipt)
        elif isinstance(ask, JointSetpoint):
            self._joint_setpoint(ask, receipt)
        elif isinstance(ask, Command):
            self._command(ask, receipt)
        else:
            self._navigate(ask, receipt)

    def _command(self, ask: Command, receipt: Receipt) -> None:
        """Take a discrete command."""
        if ask.name in STOP_WORDS:
            self._stop(ask, receipt)
            return
        own = self.own.get(ask.name)
        spec = None if own else self.can.command(ask.name)
        if own is None and spec is None:
            receipt.reject(f"{self.name} has no {ask.name!r}", hint=self.can.hint(ask.name))
            return
        first = self._repeats.first(ask.id, receipt, self._clock.monotonic())
        if first is not None:
            receipt.follow(first)
            return
        moves, safe = (spec.moves, spec.safe) if spec else (ask.name in MOTION, ask.name not in MOTION)
        refusal = self._admission.command(ask, moves=moves, safe=safe) or self.guard.beginning(ask)
        if refusal is not None:
            receipt.reject(refusal)
        elif own is not None:
            self.event_reporter.log.warning("%s by %s", ask.name, ask.origin.session or ask.origin.way)
            self._journal.note(ask.id, ask.name)
            own(ask, receipt)
        elif spec is not None:
            self._execute(spec, ask, receipt)
        self.last.follow(ask.name, receipt)

    def _execute(self, spec: CommandSpec, ask: Command, receipt: Receipt) -> None:
        """Hand a command to the adapter."""
        if self._adapter is None or self.offline:
            receipt.reject(self._absence())
            return
        superseding = spec.moves and self.in_motion
        if spec.moves:
            if not takes(spec, ask, receipt, self.activity):
                return
            self.in_control = True
            self.event_reporter.moves(ask)
            receipt.watch(self.guard.obeyed)
            self._end_driving(self._adapter)
            self._navigator.cancel(f"superseded by {ask.name}")

        def failed() -> None:
            if may_still_move(spec, receipt, superseding=superseding):
                self._executor.stop(self._settle(f"{ask.name} failed: {receipt.reason}"), "stop")

        self._executor.start(self._adapter, spec, ask, receipt, failed=failed)

    def _stop(self, ask: Command, receipt: Receipt) -> None:
        """End all motion; never refused, never a repeat."""
        if ask.name == EMERGENCY:
            self.emergency(f"asked by {ask.origin.session or ask.origin.way}")
        self._executor.cancel(f"superseded by {ask.name}")
        self._navigator.cancel(f"stopped by {ask.name}")
        self._driving.let_go()
        self._admission.stopped(ask)
        self.event_reporter.stops(ask)
        if self._adapter is None or self.offline:
            run_in_thread(self.halt, wait=HALT_WAIT)
            receipt.reject(f"{self._absence()}; {what_was_written(self._adapter, heard=self._heard)}")
        else:
            self._executor.stop(self._hold_for(ask.name, receipt), ask.name)
        self.last.follow(ask.name, receipt)
        if ask.name == EMERGENCY and self.latch.is_news():  # last: a log may be held up
            self.event_reporter.emergency_stop(ask, self.latch.why)

    async def _hold_for(self, why: str, receipt: Receipt) -> None:
        """Stop the robot and answer."""
        absence = lambda: self._absence() if self.offline else ""  # noqa: E731 - it is asked when it stands
        await answer_stop(self.hold(why), receipt, absence=absence, crashed=self._crashed)

    async def _settle(self, why: str, *, anyway: bool = False) -> None:
        """Stop the robot for nobody in particular, after something failed; ``anyway``: not only if ours."""
        if anyway or self.in_control:
            self.event_reporter.log.warning("%s: it is brought to a standstill", why)
            await self._hold_for(why, Receipt("stop", lambda _: None))

    def _setpoint(self, ask: Setpoint, receipt: Receipt) -> None:
        """Take a velocity: the newest wins, at once; a zero that comes late ends motion, and no more."""
        untimely = self._admission.is_untimely_zero(ask)
        judge = self._admission.untimely_zero if untimely else self._admission.setpoint
        adapter = self._streamed_to(self.can.refusal(ask.velocity) or judge(ask), receipt)
        if adapter is None:
            return
        if untimely:
            if self.in_motion:  # end it, all keys included; one that stands is told nothing
                self._navigator.cancel("teleoperation took over")
                self._driving.stand(adapter)
            receipt.done()
            return
        superseding, self.in_control = self.in_motion, True
        self.event_reporter.moves(ask)
        self._navigator.cancel("teleoperation took over")
        if self._driving.take(adapter, ask, receipt, superseding=superseding):
            self.last.accepted(ask.name)

    def _joint_setpoint(self, ask: JointSetpoint, receipt: Receipt) -> None:
        """Take joint targets: each joint has its newest, until its lease runs out."""
        adapter = self._streamed_to(self.can.joint_refusal or self._admission.joints(ask), receipt)
        if adapter is not None:
            self.in_control = True
            self.event_reporter.moves(ask)
            if self.joints.take(ask, receipt):
                self.last.accepted(ask.name)

    def _streamed_to(self, refusal: str | None, receipt: Receipt) -> Adapter[Any] | None:
        """Return who takes one of a stream; None when it is refused, for this or another reason."""
        if refusal is None and self._executor.moving:
            refusal = f"busy with {self._executor.moving}; send stop first"
        if refusal is not None or self._adapter is None or self.offline:
            receipt.reject(refusal or self._absence())
            return None
        return self._adapter

    def _lead(self, velocity: Velocity) -> None:
        """Drive on behalf of the host's own follower; raises Refused once the robot must stand."""
        refusal = self._admission.motion()
        if refusal is not None or self._adapter is None or self.offline:
            raise Refused(refusal or self._absence())
        self._driving.hold(self._adapter, velocity, LEASE)

    def _pilot(self) -> GoalNavigator | None:
        """Return who leads the robot to a goal: itself, or the host; None when neither can."""
        can = self.can
        return goal_navigator(self._adapter, self._leader, navigates=can.navigates, drives=can.drives)

    def _navigate(self, ask: Navigate, receipt: Receipt) -> None:
        """Take a goal, or a control of the running action."""
        if isinstance(ask.ask, Control):
            receipt.watch(partial(self.statuses.controlled, ask))
            self._control(ask, ask.ask, receipt)
            return
        if self.statuses.repeated(ask.action_id, receipt):
            return
        refusal, who = self._admission.navigate(ask) or self.unable(ask.ask), self._pilot()
        if refusal is not None or self._adapter is None or self.offline or who is None:
            receipt.reject(refusal := refusal or self._absence())
            self.statuses.refuse(ask, refusal, receipt)
            return
        self._end_driving(self._adapter)
        self.in_control = True
        self.event_reporter.moves(ask)
        receipt.accept()
        self.last.follow(ask.name, receipt)
        receipt.watch(self.guard.obeyed)
        self._navigator.start(who, ask, ask.ask, receipt)

    def unable(self, task: AnyTask) -> str | None:
        """Return why the robot would not begin a task now, whoever asks for it; None when it would."""
        busy = f"busy with {self._executor.moving}" if self._executor.moving else None
        refusal = self.can.cannot(task) or self.guard.task(task) or busy
        if refusal is not None or self.offline or self._pilot() is not None:
            return refusal
        return f"{self.name} does not navigate" + ": it has told no pose" * self.can.drives

    def _end_driving(self, adapter: Adapter[Any]) -> None:
        """End a velocity that is held, or was until its lease ran out, before the robot moves otherwise."""
        self.joints.end()
        if not self.guard.held.is_zero:
            self._driving.stand(adapter)

    def _control(self, ask: Navigate, control: Control, receipt: Receipt) -> None:
        """Stop, pause or resume the running action; a stop and a pause are never a repeat."""
        if control is Control.STOP:
            self._stop(Command("stop", origin=ask.origin, stamp=ask.stamp), receipt)
        elif control is Control.PAUSE and self._navigator.pause():
            self._executor.stop(self._hold_for("pause", receipt), "pause")
        elif control is Control.PAUSE:
            receipt.reject("there is no action to pause")
        else:
            self._resume(ask, receipt)

    def _resume(self, ask: Navigate, receipt: Receipt) -> None:
        """Go on with the paused action, once for each message that asks it."""
        if not self.statuses.knows(ask.action_id):
            identity = ask.action_id and f"resume {ask.action_id}"
            first = self._repeats.first(identity, receipt, self._clock.monotonic())
            if first is not None:
                receipt.follow(first)
                return
        refusal = self._admission.navigate(ask) or self.guard.task(self._navigator.ahead)
        if refusal is not None or (who := self._pilot()) is None or self.offline:
            receipt.reject(refusal or self._absence())
        elif self._navigator.resume(who):
            receipt.done()
        else:
            receipt.reject("there is no paused action")

    def _absence(self) -> str:
        """Return why the robot cannot be asked."""
        return f"{self.name} is offline: {self.offline or 'its adapter is being restarted'}"
