"""Arming checks of ArduPilot: those before arming, and the log that is opened on arming."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from fleet_mavlink.sim.arming_checks import ArmingChecks
from fleet_mavlink.sim.message_output import CRITICAL

if TYPE_CHECKING:
    from fleet_mavlink.sim.ardupilot import ArduPilot

_CHECKS_EVERY = 1.0  # s; RUN_PREARM_CHECKS reports its findings without changing the bit
_LOG_REOPENS = 5.0  # s after it could not be opened
_PREARM_EVERY = 30.0


class ArduPilotArming(ArmingChecks):
    """Arming checks of one ArduPilot; ``passed``: what they said when they last ran by themselves."""

    def __init__(self, pilot: ArduPilot) -> None:
        self.passed = False
        self._pilot = pilot
        self._checked_at = pilot.time
        self._repeated_at = pilot.time
        self._log_failed_at = -math.inf

    def refusals(self, *, force: bool) -> list[str]:
        """Return why the motors cannot be armed in this mode; ``force`` skips the checks after the start."""
        pilot = self._pilot
        if not pilot.initialised:
            return ["System not initialised"]
        if not pilot.mode.armable or (pilot.mode.name == "AUTO" and not pilot.missions.loaded):
            return [f"{pilot.mode.name} mode not armable"]
        remote_id = pilot.equipment.remote_id
        unsent = remote_id.refusal(pilot.time) if remote_id is not None else ""
        found = [f"OpenDroneID: {unsent}"] if unsent else []
        if force:
            return found
        if pilot.mode.position and not pilot.has_position:
            found.append("Need Position Estimate")
        if pilot.fence.is_outside((pilot.body.north, pilot.body.east, pilot.body.down)):
            found.append("Vehicle outside Polygon fence")
        if pilot.failsafes.radio_lost:
            found.append("Radio failsafe on")
        if pilot.time - self._log_failed_at < _LOG_REOPENS:
            found.append("Logging failed")
        if not pilot.uptime.reached(23.5):
            found.append("EKF3 still initialising")
        return found

    def refusals_to_arm(self, *, force: bool) -> list[str]:
        """Return the reasons against arming now. The log is opened last, and only on arming."""
        found = self.refusals(force=force)
        if found or force or "log_fails" not in self._pilot.faults:
            return found
        self._log_failed_at = self._pilot.time
        return ["Logging not started"]

    def watch(self) -> None:
        """Repeat the checks every second."""
        pilot = self._pilot
        if pilot.time - self._checked_at >= _CHECKS_EVERY:
            self._checked_at, self.passed = pilot.time, not self.refusals(force=False)

    def repeat_refusals(self) -> None:
        """Send the reasons against arming every 30 s until the motors are armed."""
        pilot = self._pilot
        if not pilot.armed and pilot.time - self._repeated_at > _PREARM_EVERY:
            self._repeated_at = pilot.time
            for refusal in self.refusals(force=False):
                pilot.say(CRITICAL, f"PreArm: {refusal}")
