"""Requests of one robot's navigation: goals, and controls (stop, pause, resume) of the running action."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from fleet.clock import Clock
from fleet.errors import Refused
from fleet.host.follow.goal_follower import LEASE, GoalNavigator, goal_follower_of, goal_navigator
from fleet.host.requests.last_command import LastCommand
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.adapter_factory import Capabilities
from fleet.host.robot.attached_adapter import AttachedAdapter
from fleet.host.robot.motion_guard import MotionGuard
from fleet.host.robot.robot_motion import RobotMotion
from fleet.host.safety.admission import Admission
from fleet.host.safety.dedup_cache import DedupCache
from fleet.model.command import Command
from fleet.model.geometry import Velocity
from fleet.model.navigation import AnyTask, Control, Navigate
from fleet.robot_config import AdapterConfig, Limits


class GoalRequests:
    """Admits navigation requests and executes them.

    ``can`` returns the robot's capabilities now, ``stop`` executes a stop, ``repeats`` has the answers to
    earlier requests. ``follower`` drives a robot to its goal that does not navigate by itself.
    """

    def __init__(
        self,
        config: AdapterConfig,
        limits: Limits,
        clock: Clock,
        attached: AttachedAdapter,
        motion: RobotMotion,
        *,
        admission: Admission,
        guard: MotionGuard,
        can: Callable[[], Capabilities],
        stop: Callable[[Command, Receipt], None],
        repeats: DedupCache[Receipt],
        last: LastCommand,
    ) -> None:
        self._attached = attached
        self._motion = motion
        self._navigator = motion.navigator
        self._admission = admission
        self._guard = guard
        self._can = can
        self._stop = stop
        self._repeats = repeats
        self._last = last
        self._clock = clock
        self.follower = goal_follower_of(
            config, self._lead, limits, clock, guard.others.of, holonomic=lambda: can().is_holonomic
        )

    def handle(self, request: Navigate, receipt: Receipt) -> None:
        """Handle a goal, or a control of the running action."""
        statuses = self._navigator.statuses
        if isinstance(request.instruction, Control):
            receipt.watch(partial(statuses.controlled, request))
            self._control(request, request.instruction, receipt)
            return
        if statuses.repeated(request.action_id, receipt):
            return
        refusal = self._admission.navigate(request) or self.task_refusal(request.instruction)
        leader, adapter = self._leader(), self._attached.reachable
        if refusal is not None or adapter is None or leader is None:
            receipt.reject(refusal := refusal or self._attached.unreachable_refusal)
            statuses.refuse(request, refusal, receipt)
            return
        self._motion.end_driving(adapter)
        self._motion.begin(request)
        receipt.accept()
        self._last.follow(request.name, receipt)
        receipt.watch(self._guard.obeyed)
        self._navigator.start(leader, request, request.instruction, receipt)

    def task_refusal(self, task: AnyTask) -> str | None:
        """Return why the robot cannot start a task now, from any sender; None if it can."""
        can, moving = self._can(), self._motion.executor.moving
        busy = f"busy with {moving}" if moving else None
        refusal = can.cannot(task) or self._guard.task(task) or busy
        if refusal is not None or self._attached.offline or self._leader() is not None:
            return refusal
        return f"{self._attached.name} does not navigate" + ": it has reported no pose" * can.drives

    def _leader(self) -> GoalNavigator | None:
        """Return the navigator of the robot: its adapter or the host's follower; None without one."""
        can = self._can()
        return goal_navigator(
            self._attached.adapter, self.follower, navigates=can.navigates, drives=can.drives
        )

    def _lead(self, velocity: Velocity) -> None:
        """Drive for the host's follower; raises Refused when motion is not allowed any more."""
        refusal, adapter = self._admission.motion(), self._attached.reachable
        if refusal is not None or adapter is None:
            raise Refused(refusal or self._attached.unreachable_refusal)
        self._motion.driving.hold(adapter, velocity, LEASE)

    def _control(self, request: Navigate, control: Control, receipt: Receipt) -> None:
        """Stop, pause or resume the running action; only a resume is checked for repeats."""
        if control is Control.STOP:
            self._stop(Command("stop", origin=request.origin, stamp=request.stamp), receipt)
        elif control is Control.PAUSE and self._navigator.pause():
            self._motion.stand("pause", receipt)
        elif control is Control.PAUSE:
            receipt.reject("there is no action to pause")
        else:
            self._resume(request, receipt)

    def _resume(self, request: Navigate, receipt: Receipt) -> None:
        """Resume the paused action, once for each message."""
        if not self._navigator.statuses.knows(request.action_id):
            identity = request.action_id and f"resume {request.action_id}"
            first = self._repeats.first(identity, receipt, self._clock.monotonic())
            if first is not None:
                receipt.follow(first)
                return
        refusal = self._admission.navigate(request) or self._guard.task(self._navigator.ahead)
        leader = self._leader()
        if refusal is not None or leader is None or self._attached.offline:
            receipt.reject(refusal or self._attached.unreachable_refusal)
        elif self._navigator.resume(leader):
            self._motion.begin(request)
            receipt.done()
        else:
            receipt.reject("there is no paused action")
