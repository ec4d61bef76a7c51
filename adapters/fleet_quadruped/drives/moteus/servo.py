"""State of one moteus servo, and its commands."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from fleet import CanFrame
from fleet_quadruped.drives.base import NEVER, Power
from fleet_quadruped.drives.damping import DampingDrive
from fleet_quadruped.drives.moteus import frames as wire
from fleet_quadruped.drives.moteus.frames import ServoCommand

_POWERS: Mapping[int, Power] = {
    wire.STOPPED: Power.DISABLED,
    wire.TIMED_OUT: Power.STOPPING,
    wire.DAMPS: Power.STOPPING,
    wire.BRAKES: Power.STOPPING,
    **dict.fromkeys(wire.STARTING, Power.STARTING),
}
_TORQUE_OFF = wire.STARTING | {wire.STOPPED}
"""Modes after a restart; a command would move the servo from wherever it believes that it is."""
_SILENT_MODES = frozenset({None, wire.STOPPED, wire.FAILED, wire.TIMED_OUT})
"""Modes without a damping command: the servo has no torque, or damps already."""


@dataclass(slots=True)
class MoteusServo(DampingDrive):
    """One servo. ``kp`` (N m/turn) and ``kd`` (N m s/turn) of the motor: gains of the description.

    ``watchdog``: s of silence after which it damps. ``full_kd``: configured damping, N m s/turn.
    """

    kp: float
    kd: float
    watchdog: float
    mode: int | None = None
    home: int = wire.REFERS_TO_NOTHING
    code: int = 0
    kp_scale: float = 0.0
    kd_scale: float = 0.0
    full_kd: float = math.inf

    def handle_registers(self, registers: dict[int, float], data: bytes, now: float) -> None:
        """Process the registers of a whole answer (``frames.reply``)."""
        turns, speed, torque = registers[wire.POSITION], registers[wire.VELOCITY], registers[wire.TORQUE]
        self.angle, self.speed, self.torque = self.units.joint(turns * wire.TURN, speed * wire.TURN, torque)
        self.mode, self.code = int(registers[wire.MODE]), int(registers[wire.FAULT])
        self.home = int(registers[wire.HOME])
        self.voltage, self.temperature = registers[wire.VOLTAGE], registers[wire.TEMPERATURE]
        self.reported_at = now
        self.answers.add(data)
        self.note_hold(obeys=self.mode == wire.OBEYS, torque_off=self.mode in _TORQUE_OFF)

    def power(self, now: float) -> tuple[Power, str]:  # noqa: ARG002 - a servo answers in each cycle, or is old
        """Return the state of the servo, and its fault."""
        mode = self.mode
        if self.reported_at == NEVER or mode is None:
            return Power.ABSENT, ""
        fault = self._fault()
        if fault:
            return Power.FAULT, fault
        return (self.obeying if mode == wire.OBEYS else _POWERS[mode]), ""

    def _fault(self) -> str:
        """Return the fault of the servo, empty without one."""
        mode = self.mode
        if mode == wire.FAILED:
            return f"{wire.FAULTS.get(self.code, 'fault')} (register 00Fh is {self.code})"
        if self.answers.doubled:
            return self.duplicate_id_fault
        if self.restarted:
            return self.torque_off_fault("mode 0")
        known = mode == wire.OBEYS or mode in _POWERS
        return "" if known else f"id {self.id} is in mode {mode}, which was not commanded"

    def torque_limit(self, most: float | None = None) -> float:
        """Return the torque limit (N m of the motor), at most that of the joint."""
        kind = self.joint.kind
        return (kind.torque if most is None else min(kind.torque, most)) / kind.ratio

    def hold_limp(self, most: float) -> None:
        """Request position mode at the present position, without force; ``most``: N m of the motor."""
        limp = ServoCommand(math.nan, 0.0, 0.0, 0.0, 0.0, most, self.watchdog)
        self.send(wire.pack_demand(wire.OBEYS, limp))

    def damp(self, kd: float) -> None:
        """Zero velocity: no stiffness, damping only (N m s/rad). A servo without torque is only polled."""
        if self.mode in _SILENT_MODES:
            self.send(wire.pack_query())
            return
        share = min(1.0, kd / self.joint.kind.ratio**2 * wire.TURN / self.full_kd)
        demand = ServoCommand(math.nan, 0.0, 0.0, 0.0, share, self.torque_limit(), self.watchdog)
        self.send(wire.pack_demand(wire.DAMPS, demand))

    def disable(self) -> None:
        """Stop: no torque. A servo with a fault has none and is only polled: a stop would clear its fault."""
        off = self.mode in {wire.FAILED, wire.STOPPED}
        self.send(wire.pack_query() if off else wire.pack_mode(wire.STOPPED))

    def send(self, data: bytes) -> None:
        """Send sub-frames."""
        self.bus.send(self.frame(data))

    def frame(self, data: bytes) -> CanFrame:
        """Return the frame with these sub-frames for the servo."""
        return CanFrame(wire.to_servo(self.id), data, fd=True)
