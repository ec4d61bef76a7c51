"""Requests of one robot's setpoint streams: velocities and joint targets."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fleet.adapter import Adapter
from fleet.host.requests.last_command import LastCommand
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.adapter_factory import Capabilities
from fleet.host.robot.attached_adapter import AttachedAdapter
from fleet.host.robot.robot_motion import RobotMotion
from fleet.host.safety.admission import Admission
from fleet.model.command import JointSetpoint, Setpoint


class SetpointRequests:
    """Admits the setpoints of one robot and executes them; ``can`` returns its capabilities now."""

    def __init__(
        self,
        attached: AttachedAdapter,
        motion: RobotMotion,
        admission: Admission,
        *,
        can: Callable[[], Capabilities],
        last: LastCommand,
    ) -> None:
        self._attached = attached
        self._motion = motion
        self._admission = admission
        self._can = can
        self._last = last

    def velocity(self, request: Setpoint, receipt: Receipt) -> None:
        """Take a velocity: the newest wins, at once. A late zero only ends motion."""
        untimely = self._admission.is_untimely_zero(request)
        judge = self._admission.untimely_zero if untimely else self._admission.setpoint
        adapter = self._adapter_for(self._can().refusal(request.velocity) or judge(request), receipt)
        if adapter is None:
            return
        motion = self._motion
        if untimely:
            if motion.under_way:  # end it, held keys included; a standing robot gets no command
                motion.navigator.cancel("teleoperation took over")
                motion.driving.stand(adapter)
            receipt.done()
            return
        superseding = motion.under_way
        if motion.in_control or not request.velocity.is_zero:  # a zero does not take over the robot
            motion.begin(request)
        motion.navigator.cancel("teleoperation took over")
        if motion.driving.apply(adapter, request, receipt, superseding=superseding):
            self._last.accepted(request.name)
        else:
            motion.not_begun(receipt)

    def joints(self, request: JointSetpoint, receipt: Receipt) -> None:
        """Take joint targets: each joint follows its newest one until the lease expires."""
        adapter = self._adapter_for(self._can().joint_refusal or self._admission.joints(request), receipt)
        if adapter is not None and self._motion.driving.joints.apply(request, receipt):
            self._motion.begin(request)
            self._last.accepted(request.name)

    def _adapter_for(self, refusal: str | None, receipt: Receipt) -> Adapter[Any] | None:
        """Return the adapter for a setpoint; None after rejecting it, for ``refusal`` or another reason."""
        moving, adapter = self._motion.executor.moving, self._attached.reachable
        if refusal is None and moving:
            refusal = f"busy with {moving}; send stop first"
        if refusal is not None or adapter is None:
            receipt.reject(refusal or self._attached.unreachable_refusal)
            return None
        return adapter
