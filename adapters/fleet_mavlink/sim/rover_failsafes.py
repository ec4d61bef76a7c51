"""Fail-safes of ArduRover: loss of remote control or station, battery, position or fence."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fleet_mavlink.sim.ardupilot_failsafes import ArduPilotFailsafes
from fleet_mavlink.sim.message_output import CRITICAL, INFO, WARNING
from fleet_mavlink.sim.streams import heartbeat

if TYPE_CHECKING:
    from fleet_mavlink.sim.rover import SimArduRover

_STATION_WITHIN = 0.5  # s of silence that count as lost; then FS_TIMEOUT runs
_MODES = {1: "RTL", 2: "HOLD", 3: "RTL", 4: "HOLD"}  # FS_ACTION, BATT_FS_LOW_ACT, FENCE_ACTION


class RoverFailsafes(ArduPilotFailsafes):
    """Fail-safes of one ArduRover (from its source): FS_ACTION after FS_TIMEOUT, never out of HOLD."""

    def __init__(self, pilot: SimArduRover) -> None:
        super().__init__(pilot)
        self._lost: dict[str, float] = {}  # losses, with their start
        self._reported: set[str] = set()
        self._ekf = False

    def watch(self) -> None:
        """Check all of them."""
        pilot = self._pilot
        heard = pilot.gcs_heard_at
        self.radio_lost = not pilot.remote_control and bool(pilot.params["FS_THR_ENABLE"])
        silent = heard is not None and pilot.time - heard > _STATION_WITHIN
        self._lose("GCS", lost=silent and bool(pilot.params["FS_GCS_ENABLE"]))
        self._lose("Throttle", lost=self.radio_lost)
        if not pilot.armed:
            return
        self._watch_battery()
        self._watch_position()
        pilot.fence.watch(self._broke_fence)

    def _lose(self, what: str, *, lost: bool) -> None:
        """Track one loss; FS_ACTION is executed after FS_TIMEOUT, unless it holds or returns already."""
        pilot = self._pilot
        if not lost:
            self._lost.pop(what, None)
            if what in self._reported:
                self._reported.discard(what)
                pilot.say(INFO, f"{what} Failsafe Cleared")
            return
        since = self._lost.setdefault(what, pilot.time)
        busy = pilot.mode.name not in {"RTL", "HOLD"}
        if what in self._reported or not busy or pilot.time - since <= pilot.params["FS_TIMEOUT"]:
            return
        self._reported.add(what)
        pilot.say(WARNING, f"{what} Failsafe")
        self._act(int(pilot.params["FS_ACTION"]))

    def _act(self, action: int) -> None:
        """Change the mode by one of the ACTION parameters; HOLD without a position."""
        pilot = self._pilot
        mode = _MODES.get(action)
        if mode is not None:
            pilot.enter(pilot.modes[mode if pilot.has_position else "HOLD"])
            pilot.out.append(heartbeat(pilot))

    def _battery_failed(self, text: str) -> None:
        """Act by BATT_FS_LOW_ACT."""
        self._pilot.say(WARNING, text)
        self._act(int(self._pilot.params["BATT_FS_LOW_ACT"]))

    def _watch_position(self) -> None:
        """Act by FS_EKF_ACTION: with 1, HOLD if the position is lost in a mode that needs it."""
        pilot = self._pilot
        if pilot.has_position:
            self._ekf = False
        elif pilot.mode.position and not self._ekf:
            self._ekf = True
            if int(pilot.params["FS_EKF_ACTION"]) == 1:
                pilot.enter(pilot.modes["HOLD"])
                pilot.out.append(heartbeat(pilot))
            pilot.say(CRITICAL, "EKF failsafe")

    def _broke_fence(self) -> None:
        """Act by FENCE_ACTION."""
        self._pilot.say(WARNING, "Fence Breached")
        self._act(int(self._pilot.params["FENCE_ACTION"]))
