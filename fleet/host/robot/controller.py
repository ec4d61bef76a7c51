"""The controller of one robot: admits and executes every request to it.

A decoded request passes admission (sender, age, control lease), then goes to the adapter; the answer is the
observed outcome. Runs on the event loop, except ``emergency`` and ``halt``, which any thread may call.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from fleet.adapter import Adapter
from fleet.clock import Clock
from fleet.commands import CommandSpec
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.decode import RobotRequest
from fleet.host.requests.event_reporter import EventReporter
from fleet.host.requests.last_command import LastCommand
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.adapter_factory import Capabilities
from fleet.host.robot.attached_adapter import AttachedAdapter
from fleet.host.robot.control_commands import control_commands
from fleet.host.robot.executor import admits, may_still_move
from fleet.host.robot.goal_requests import GoalRequests
from fleet.host.robot.host_commands import MOTION, host_commands
from fleet.host.robot.motion_guard import MotionGuard
from fleet.host.robot.robot_motion import RobotMotion
from fleet.host.robot.setpoint_requests import SetpointRequests
from fleet.host.robot.velocity_control import VelocityControl
from fleet.host.runtime.threads import HALT_WAIT, call_sequentially
from fleet.host.safety.admission import Admission
from fleet.host.safety.emergency_stop import EmergencyStopLatch
from fleet.host.safety.verb_speeds import VerbSpeeds
from fleet.model.command import Command, JointSetpoint, Setpoint
from fleet.model.report import Report
from fleet.robot_config import AdapterConfig
from fleet.wire.stops import EMERGENCY, STOP_WORDS


class RobotController:
    """Admits, executes and answers the requests to one robot.

    ``publish`` takes reports; ``crashed`` is called when the adapter crashes; ``restart`` restarts its run;
    ``journal`` has the requests of earlier processes.

    ``attached`` is the robot's adapter, ``motion`` all motion that this edge causes. ``SetpointRequests``
    takes velocities and joint targets, ``goals`` takes goals; commands and all stops are taken here.
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
        self._clock, self._journal = clock, journal
        self._repeats = journal.repeats(clock.monotonic())
        self._unheard_stop = False  # an emergency stop that may not have reached the robot
        limits = config.limits.over(capabilities.limits)
        self.attached = attached = AttachedAdapter(config.name)
        self.speeds, self.latch = VerbSpeeds(limits), EmergencyStopLatch(journal.latched, journal.latch)
        self._admission = admission = Admission(config, clock, self.latch, self.speeds)
        self.permit, self.lease, self.senders = admission.permit, admission.lease, admission.offsets
        self.would_refuse = admission.would_refuse
        self.event_reporter = EventReporter(self.name, publish, clock, in_motion=lambda: self.in_motion)
        self.guard = MotionGuard(config, limits, clock, robot=self, event_reporter=self.event_reporter)
        driving = VelocityControl(
            limits,
            clock,
            config.setpoint_lease,
            self.guard,
            combines=capabilities.combines_keys,
            barred=admission.motion,
            halt=self.halt,
            crashed=crashed,
        )
        self.deadman, self.joints, self.reapply_velocity = (
            driving.deadman,
            driving.joints,
            driving.reapply_velocity,
        )
        self.motion = motion = RobotMotion(
            attached,
            self.guard,
            driving,
            self.event_reporter,
            publish=publish,
            crashed=crashed,
            clock=clock,
            journal=journal,
        )
        self.current_task, self.statuses = motion.navigator.current_task, motion.navigator.statuses
        # ``can`` changes with the configuration, and when the adapter reports what this robot lacks.
        self._setpoints = SetpointRequests(attached, motion, admission, can=lambda: self.can, last=self.last)
        self.goals = GoalRequests(
            config,
            limits,
            clock,
            attached,
            motion,
            admission=admission,
            guard=self.guard,
            can=lambda: self.can,
            stop=self._stop,
            repeats=self._repeats,
            last=self.last,
        )
        self.task_refusal = self.goals.task_refusal
        self.observe = self.goals.follower.observe  # its poses
        self.own = host_commands(
            release=self.latch.release,
            restart=restart,
            store=self.speeds.store,
            drives=capabilities.drives,
            follow=self.joints.follow if config.follows and capabilities.moves_joints else None,
            absence=lambda: attached.unreachable_refusal if attached.reachable is None else "",
        ) | control_commands(admission, self._stop)
        self.configured = (admission, self.speeds, self.guard, driving, self.goals.follower)

    @property
    def latched(self) -> bool:
        """True while an emergency stop is set."""
        return self.latch.set

    @property
    def offline(self) -> str:
        """Why the robot cannot be reached; empty while it can."""
        return self.attached.offline

    @property
    def activity(self) -> str:
        """The current activity in a word or two, "emergency stop" while one is set; empty when idle."""
        return "emergency stop" if self.latched else self.motion.activity

    @property
    def in_motion(self) -> bool:
        """True while the robot moves, or may move, because of a request to this edge."""
        return self.motion.under_way

    @property
    def free(self) -> bool:
        """True when the host may act by itself: in control, no emergency stop, no landing in progress."""
        return self.motion.in_control and not (self.latched or self.motion.executor.safe)

    # -- reachability of the robot -------------------------------------------------------------------

    def attach(self, adapter: Adapter[Any]) -> None:
        """Attach the adapter of a new run; until ``found`` it is only asked to stop."""
        self.attached.attach(adapter)
        self.joints.attach(adapter)

    def found(self) -> None:
        """Handle the robot's first answer: it takes requests from now on."""
        self.attached.mark_reachable()
        self._admission.fault = ""
        self.motion.found()
        self._stop_again()

    def faulted(self, why: str) -> None:
        """Handle a fault that the robot reports: it is halted until ``found``; a landing continues."""
        before, self._admission.fault = self._admission.fault, why
        self.attached.mark_reachable()
        self.motion.found()
        self._stop_again()
        if before or self.motion.executor.safe:
            return
        if self.motion.in_control:
            self.halt()
        self.motion.fail(why, halted=self.motion.in_control)

    def lost(self, why: str) -> None:
        """Handle the loss of the robot: its running requests fail, and are never resumed.

        A robot that is controlled by others is not halted.
        """
        if not self.offline:
            self.motion.lost()
            if self.motion.in_control or self.motion.may_be_moving:
                self.halt()
        self.attached.offline, self._admission.fault = why, ""
        self.motion.fail(why)

    def detach(self, why: str) -> None:
        """Detach the adapter at the end of its run."""
        try:
            self.lost(why)
        finally:
            self._admission.taken_over(f"lost: {why}")
            self.joints.forget()
            self.attached.detach()
            self.motion.in_control = False

    def authority_lost(self, reason: str) -> None:
        """Handle the loss of control to a pilot or another station: motion ends until a new command."""
        self.event_reporter.authority_lost(reason)
        self.motion.fail(f"authority lost: {reason}")
        self._admission.taken_over(f"taken: authority lost: {reason}")
        self.motion.taken_over()
        self.guard.taken = True

    def end(self, why: str) -> None:
        """End motion that this edge causes, for a reason; a landing or a return home continues."""
        if self.free and self.in_motion:
            self.motion.fail(why)
            self.motion.settle_later(why)

    # -- stops ---------------------------------------------------------------------------------------

    def emergency(self, why: str) -> None:
        """Latch, write the halt, record; the last two may block. On any thread; ``receive`` follows."""
        self.latch.engage(why)
        call_sequentially((partial(self.halt, emergency=True), self.latch.record), wait=HALT_WAIT)

    def halt(self, *, emergency: bool = False) -> None:
        """Write the halt at once; from any thread, such as the watchdog; never raises."""
        self.attached.halt(emergency=emergency)

    def _stop(self, request: Command, receipt: Receipt) -> None:
        """End all motion; a stop is never refused, and never treated as a repeat."""
        if request.name == EMERGENCY:
            self.emergency(f"asked by {request.origin.session or request.origin.transport}")
        self.motion.cancel(request.name)
        self._admission.stopped(request)
        self.event_reporter.stops(request)
        if self.attached.reachable is None:
            self._unheard_stop |= request.name == EMERGENCY
            outcome = self.attached.halt_unheard(request.name, wait=HALT_WAIT)
            receipt.reject(f"{self.attached.unreachable_refusal}; {outcome}")
        else:
            self.motion.stand(request.name, receipt)
        self.last.follow(request.name, receipt)
        if request.name == EMERGENCY and self.latch.is_first_report():  # last: logging may block
            self.event_reporter.emergency_stop(request, self.latch.cause)

    def _stop_again(self) -> None:
        """Repeat an emergency stop that was requested while the robot could not be reached."""
        unheard, self._unheard_stop = self._unheard_stop, False
        if unheard and self.latched:
            self.motion.settle_later(EMERGENCY, anyway=True)

    # -- requests ------------------------------------------------------------------------------------

    def receive(self, request: RobotRequest, receipt: Receipt) -> None:
        """Handle a request; its receipt is answered exactly once."""
        match request:
            case Setpoint():
                self._setpoints.velocity(request, receipt)
            case JointSetpoint():
                self._setpoints.joints(request, receipt)
            case Command():
                self._command(request, receipt)
            case _:
                self.goals.handle(request, receipt)
        self.motion.record()

    def _command(self, request: Command, receipt: Receipt) -> None:
        """Admit a discrete command and execute it."""
        if request.name in STOP_WORDS:
            self._stop(request, receipt)
            return
        own = self.own.get(request.name)
        spec = None if own else self.can.command(request.name)
        if own is None and spec is None:
            receipt.reject(f"{self.name} has no {request.name!r}", hint=self.can.hint(request.name))
            return
        first = self._repeats.first(request.id, receipt, self._clock.monotonic())
        if first is not None:
            receipt.follow(first)
            return
        moves, safe = (
            (spec.moves, spec.safe) if spec else (request.name in MOTION, request.name not in MOTION)
        )
        refusal = self._admission.command(request, moves=moves, safe=safe) or self.guard.beginning(
            request, spec
        )
        if refusal is not None:
            receipt.reject(refusal)
        elif own is not None:
            self.event_reporter.log.warning(
                "%s by %s", request.name, request.origin.session or request.origin.transport
            )
            self._journal.note(request.id, request.name, receipt=receipt)
            own(request, receipt)
        elif spec is not None:
            self._execute(spec, request, receipt)
        self.last.follow(request.name, receipt)

    def _execute(self, spec: CommandSpec, request: Command, receipt: Receipt) -> None:
        """Hand a command to the adapter."""
        adapter, motion = self.attached.reachable, self.motion
        if adapter is None:
            receipt.reject(self.attached.unreachable_refusal)
            return
        superseding = spec.moves and motion.under_way
        if spec.moves:
            if not admits(spec, request, receipt, self.activity):
                return
            motion.begin(request)
            receipt.watch(self.guard.obeyed)
            motion.end_driving(adapter)
            motion.navigator.cancel(f"superseded by {request.name}")

        def failed() -> None:
            if may_still_move(spec, receipt, superseding=superseding):
                motion.settle_later(f"{request.name} failed: {receipt.reason}")
            elif spec.moves:
                motion.not_begun(receipt)

        motion.executor.start(adapter, spec, request, receipt, failed=failed)
