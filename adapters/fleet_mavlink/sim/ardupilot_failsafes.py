"""Fail-safes of ArduCopter: loss of remote control, station, battery, position or fence."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fleet_mavlink.sim.ardupilot_modes import MODES
from fleet_mavlink.sim.message_output import CRITICAL, WARNING
from fleet_mavlink.sim.streams import heartbeat

if TYPE_CHECKING:
    from fleet_mavlink.sim.ardupilot import ArduPilot

_GCS_LANDS = 5  # FS_GCS_ENABLE
_RADIO_LANDS, _RADIO_LEAVES_AUTO = 3, 2  # FS_THR_ENABLE
_CONTINUES = (("AUTO", 1, "Auto"), ("GUIDED", 4, "Guided Mode"), ("LAND", 8, "Landing"))  # mode, FS_OPTIONS


class ArduPilotFailsafes:
    """The fail-safes of one ArduCopter."""

    def __init__(self, pilot: ArduPilot) -> None:
        self.radio_lost = False
        self._pilot = pilot
        self._low_since: float | None = None
        self._battery_acted = False

    def watch(self) -> None:
        """Check all of them."""
        pilot = self._pilot
        self._watch_radio()
        if pilot.armed and pilot.flying:
            self._watch_gcs()
            self._watch_battery()
            self._watch_position()
            pilot.fence.watch(self._broke_fence)
        elif not pilot.armed:
            pilot.failsafe = ""

    def _fail(self, why: str, text: str, mode: str) -> None:
        """Begin a fail-safe: send its text, set it, change the mode."""
        pilot = self._pilot
        pilot.failsafe = why
        pilot.say(CRITICAL, text)
        pilot.enter(MODES[mode] if pilot.has_position else MODES["LAND"])
        pilot.out.append(heartbeat(pilot))

    def _watch_radio(self) -> None:
        """Detect its loss, never with FS_THR_ENABLE 0; cleared by its return, and the mode stays."""
        pilot = self._pilot
        if pilot.remote_control:
            if self.radio_lost:
                self.radio_lost = False
                pilot.say(WARNING, "Radio Failsafe Cleared")
        elif not self.radio_lost and pilot.params["FS_THR_ENABLE"]:
            self.radio_lost = True
            if pilot.armed:
                self._radio_failed()

    def _radio_failed(self) -> None:
        """Disarm on the ground; in the air return, land or continue, by FS_THR_ENABLE and FS_OPTIONS."""
        pilot = self._pilot
        action = int(pilot.params["FS_THR_ENABLE"])
        options = int(pilot.params["FS_OPTIONS"]) | (action == _RADIO_LEAVES_AUTO)
        goes_on = [words for mode, bit, words in _CONTINUES if mode == pilot.mode.name and options & bit]
        if not pilot.flying:
            pilot.say(WARNING, "Radio Failsafe - Disarming")
            pilot.disarm()
        elif goes_on:
            pilot.say(WARNING, f"Radio Failsafe - Continuing {goes_on[0]}")
        else:
            self._fail("radio", "Radio Failsafe", "LAND" if action == _RADIO_LANDS else "RTL")

    def _watch_gcs(self) -> None:
        """Fail after FS_GCS_TIMEOUT without the station; FS_GCS_ENABLE 1: RTL, 5: LAND."""
        pilot = self._pilot
        if not pilot.params["FS_GCS_ENABLE"] or pilot.gcs_heard_at is None or pilot.failsafe:
            return
        if pilot.time - pilot.gcs_heard_at > pilot.params["FS_GCS_TIMEOUT"]:
            self._fail(
                "gcs", "GCS Failsafe", "LAND" if pilot.params["FS_GCS_ENABLE"] == _GCS_LANDS else "RTL"
            )

    def _watch_battery(self) -> None:
        """Fail once below BATT_LOW_VOLT for BATT_LOW_TIMER."""
        pilot = self._pilot
        battery, params = pilot.battery, pilot.params
        if battery.volts >= params["BATT_LOW_VOLT"]:
            self._low_since = None
            return
        self._low_since = pilot.time if self._low_since is None else self._low_since
        if self._battery_acted or pilot.time - self._low_since < params["BATT_LOW_TIMER"]:
            return
        self._battery_acted = True
        self._battery_failed(f"Battery 1 is low {battery.volts:.2f}V used {battery.used_mah:.0f} mAh")

    def _battery_failed(self, text: str) -> None:
        """Act by BATT_FS_LOW_ACT: 1 lands, 2 returns."""
        mode = {1: "LAND", 2: "RTL"}.get(int(self._pilot.params["BATT_FS_LOW_ACT"]))
        if mode is None:
            self._pilot.say(WARNING, text)
        else:
            self._fail("battery", text, mode)

    def _watch_position(self) -> None:
        """Land if the position is lost in a mode that needs it; the mode stays when it is back.

        The heartbeat with the new mode is sent before the texts.
        """
        pilot = self._pilot
        if pilot.mode.position and not pilot.has_position and pilot.failsafe != "ekf":
            pilot.failsafe = "ekf"
            pilot.say(CRITICAL, "EKF3 lane switch 1")
            pilot.say(WARNING, "EKF primary changed:1")
            pilot.enter(MODES["LAND"])
            pilot.out.append(heartbeat(pilot))
            pilot.say(CRITICAL, "EKF variance")
            pilot.say(CRITICAL, "EKF Failsafe: changed to LAND Mode")
        elif pilot.failsafe == "ekf" and pilot.has_position:
            pilot.failsafe = ""
            pilot.say(CRITICAL, "EKF Failsafe Cleared")

    def _broke_fence(self) -> None:
        """Act by FENCE_ACTION: 0 only sends the text, 1: RTL."""
        if self._pilot.params["FENCE_ACTION"]:
            self._fail("fence", "Fence Breached", "RTL")
        else:
            self._pilot.say(WARNING, "Fence Breached")
