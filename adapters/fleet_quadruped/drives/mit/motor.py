"""State of one MIT motor, and its commands."""

from __future__ import annotations

from dataclasses import dataclass

from fleet import CanFrame
from fleet_quadruped.drives.base import NEVER, Power
from fleet_quadruped.drives.damping import DampingDrive
from fleet_quadruped.drives.mit import frames as wire
from fleet_quadruped.drives.mit.frames import MitCommand
from fleet_quadruped.drives.mit.profiles import MotorProfile


@dataclass(slots=True)
class MitMotor(DampingDrive):
    """One motor. ``gains``: those of the description, as encoded in a command.

    A Damiao motor reports whether it is enabled (``status``). For the others it follows from the commands:
    ``enabled``: it was commanded. ``unknown``: no command to be on or off was sent yet, so it may be holding.
    ``answered``: it has answered since it was commanded to be enabled.
    """

    profile: MotorProfile
    layout: wire.MitLayout
    gains: int
    status: int | None = None
    enabled: bool = False
    unknown: bool = True
    answered: bool = False

    def handle_reply(self, data: bytes, now: float) -> None:
        """Process a reply; one that is too short is ignored."""
        reply = self.layout.unpack_reply(data)
        if reply is None:
            return
        _, angle, speed, torque, self.status, self.temperature = reply
        self.angle, self.speed, self.torque = self.units.joint(angle, speed, torque)
        self.reported_at, self.answered = now, True
        self.answers.add(data)
        if self.profile.damiao:  # the status of another motor is its error
            self.note_hold(obeys=self.status == wire.ENABLED, torque_off=self.status == wire.DISABLED)

    @property
    def is_enabled(self) -> bool:
        """True if the motor certainly follows commands."""
        if self.profile.damiao:
            return self.status == wire.ENABLED
        return self.enabled and self.answered

    def power(self, now: float) -> tuple[Power, str]:  # noqa: ARG002 - a motor answers in each cycle, or is old
        """Return the state of the motor, and its fault."""
        if self.reported_at == NEVER:
            return Power.ABSENT, ""
        fault = self._fault()
        if fault:
            return Power.FAULT, fault
        may_hold = self.is_enabled or (self.unknown and not self.profile.damiao)
        return self.obeying if may_hold else Power.DISABLED, ""

    def _fault(self) -> str:
        """Return the fault of the motor, empty without one."""
        status = self.status
        if self.profile.damiao and status is not None and status in wire.STATUS:
            return f"{wire.STATUS[status]} (status {status:X}h)"
        if self.profile.error_at is not None and status:
            return f"error {status} of the motor"
        if self.answers.doubled:
            return self.duplicate_id_fault
        return self.torque_off_fault("status 0h") if self.restarted else ""

    def enable(self) -> None:
        """Enable the motor; one that is enabled is held without force, so that it does not jerk."""
        if self.is_enabled:
            self.send(self.layout.pack_command(MitCommand(self.joint.motor(self.angle))))
            return
        self.answered = self.answered and self.enabled
        self.enabled, self.unknown = True, False
        self.send(wire.ENABLE)

    def disable(self) -> None:
        """Take the torque off."""
        self.enabled = self.unknown = False
        self.send(wire.DISABLE)

    def damping(self, kd: float) -> CanFrame:
        """Return the damping command (N m s/rad); a motor that is off stays off, and answers."""
        damped = MitCommand(self.joint.motor(self.angle), kd=kd / self.joint.kind.ratio**2)
        return CanFrame(self.id, self.layout.pack_command(damped))

    def send(self, data: bytes) -> None:
        """Send a command."""
        self.bus.send(CanFrame(self.id, data))
