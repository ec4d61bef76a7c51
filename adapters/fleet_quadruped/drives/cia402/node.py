"""State of one CiA 402 drive from its PDOs, emergencies and heartbeats."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fleet_quadruped.drives.base import NEVER, Power
from fleet_quadruped.drives.cia402.frames import (
    BOOT_UP,
    OPERATIONAL,
    OUR_SILENCE,
    CountUnits,
    meaning,
    unpack_emergency,
    unpack_slow,
)
from fleet_quadruped.drives.cia402.states import FOLLOWS, POWER, DriveState, state_of
from fleet_quadruped.drives.group import ReportingDrive


@dataclass(slots=True)
class Cia402Node(ReportingDrive):
    """One drive. ``half_cycle``: s; ``silence``: s without a heartbeat until a fault.

    ``scale``: degrees C of the drive's own unit; None without a temperature. ``feeds``: it accepts a torque
    offset. ``nmt``: NMT state from its heartbeat. ``stopped_alone``: it missed our heartbeat, and may go on
    with the next control word.
    """

    units: CountUnits
    half_cycle: float
    silence: float
    scale: float | None
    status: int = 0  # 6041h
    state: DriveState = DriveState.NOT_READY
    follows: bool = True
    heartbeat_at: float = math.inf
    fault: str = ""
    feeds: bool = True
    nmt: int = OPERATIONAL
    stopped_alone: bool = False

    def configured(self, *, feeds: bool) -> None:
        """Reset for a drive that was configured and started."""
        self.reported_at, self.heartbeat_at = NEVER, math.inf
        self.fault, self.restarted, self.nmt = "", False, OPERATIONAL
        self.feeds = feeds

    def power(self, now: float) -> tuple[Power, str]:
        """Return the state of the drive, and its fault."""
        if self.reported_at == NEVER:
            return Power.ABSENT, ""
        if self.restarted or self.answers.doubled or now - self.heartbeat_at > self.silence:
            unreliable = self._why_unreliable(now)
            return Power.FAULT, (self.restarted and unreliable) or self.fault or unreliable
        if self.state is DriveState.ENABLED and self.stopped_alone:
            return Power.STOPPING, self.fault
        if self.state is DriveState.ENABLED and self.nmt != OPERATIONAL:
            return Power.STOPPING, f"id {self.joint.id} has left operation (heartbeat {self.nmt:02X}h)"
        if not self.follows:
            return Power.STARTING, "it is enabled and ignores its target (bit 12 of 6041h is 0)"
        return POWER[self.state], self.fault

    def _why_unreliable(self, now: float) -> str:
        """Return why the status word of the drive cannot be relied on."""
        number = self.joint.id
        if self.restarted:
            return f"id {number} has restarted (boot-up, 700h); it is configured again after a reset"
        if self.answers.doubled:
            return self.duplicate_id_fault
        return f"no heartbeat (700h) from id {number} for {now - self.heartbeat_at:.2f} s"

    def handle_status(self, data: bytes, now: float) -> None:
        """Process a TPDO1: status, angle, torque; the speed is the difference of two angles."""
        decoded = self.units.unpack(data)
        if decoded is None:
            return
        status, angle, self.torque = decoded
        passed = now - self.reported_at
        # A late answer arrives together with the next one; they were measured a cycle apart.
        if passed > self.half_cycle:
            self.speed = (angle - self.angle) / passed
        self.angle, self.reported_at = angle, now
        if status != self.status:
            self.status, self.state = status, state_of(status)
            self.stopped_alone = self.stopped_alone and self.state is DriveState.ENABLED
            self.follows = self.state is not DriveState.ENABLED or status & FOLLOWS != 0
        self.answers.add(data)

    def handle_slow(self, data: bytes, _now: float) -> None:
        """Process a TPDO2: voltage, temperature, and the code of a fault without an emergency."""
        slow = unpack_slow(data)
        if slow is None:
            return
        self.voltage = slow.voltage
        if slow.temperature is not None and self.scale is not None:
            self.temperature = slow.temperature * self.scale
        if slow.code and self.state in {DriveState.FAULT, DriveState.FAULT_REACTION}:
            self.fault = self.fault or f"{meaning(slow.code)} (603Fh is {slow.code:04X}h)"

    def handle_emergency(self, data: bytes, _now: float) -> None:
        """Process an emergency."""
        decoded = unpack_emergency(data)
        if decoded is not None:
            self.fault = "" if decoded.cleared else decoded.text
            self.stopped_alone = decoded.code == OUR_SILENCE

    def handle_heartbeat(self, data: bytes, now: float) -> None:
        """Process a heartbeat; a boot-up after the first one means a restart."""
        if not data:  # a frame without the state is no sign of life
            return
        state = data[0] & 0x7F
        if state == BOOT_UP and self.heartbeat_at < math.inf:
            self.restarted = True
        if state != BOOT_UP:
            self.nmt = state
        self.heartbeat_at = now
