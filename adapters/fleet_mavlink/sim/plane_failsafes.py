"""Fail-safes of ArduPlane: loss of remote control or station, battery or fence."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fleet_mavlink.sim.ardupilot_failsafes import ArduPilotFailsafes
from fleet_mavlink.sim.message_output import WARNING
from fleet_mavlink.sim.streams import heartbeat

if TYPE_CHECKING:
    from fleet_mavlink.sim.plane import SimArduPlane

_HOME = 1  # FS_LONG_ACTN, BATT_FS_LOW_ACT, FENCE_ACTION


class PlaneFailsafes(ArduPilotFailsafes):
    """Fail-safes of one ArduPlane (from its source): RTL, FS_LONG_TIMEOUT after a loss."""

    def __init__(self, pilot: SimArduPlane) -> None:
        super().__init__(pilot)
        self._plane = pilot
        self._lost_at: dict[str, float] = {}
        self._acted: set[str] = set()

    def watch(self) -> None:
        """Check all of them."""
        pilot = self._pilot
        heard = pilot.gcs_heard_at
        self.radio_lost = not pilot.remote_control and bool(pilot.params["THR_FAILSAFE"])
        if not (pilot.armed and pilot.flying):
            return
        silent = heard is not None and pilot.time - heard > 1.0
        self._lose("GCS", lost=silent and bool(pilot.params["FS_GCS_ENABL"]))
        self._lose("RC Long", lost=self.radio_lost)
        self._watch_battery()
        pilot.fence.watch(self._broke_fence)

    def _lose(self, what: str, *, lost: bool) -> None:
        """Track one loss; FS_LONG_ACTN is executed after FS_LONG_TIMEOUT."""
        pilot = self._pilot
        if not lost:
            self._lost_at.pop(what, None)
            self._acted.discard(what)
            return
        since = self._lost_at.setdefault(what, pilot.time)
        if what in self._acted or pilot.time - since <= pilot.params["FS_LONG_TIMEOUT"]:
            return
        self._acted.add(what)
        pilot.say(WARNING, f"{what} Failsafe On")
        self._act(int(pilot.params["FS_LONG_ACTN"]))

    def _act(self, action: int) -> None:
        """Fly home, if one of the ACTION parameters requests it."""
        pilot = self._plane
        if action == _HOME and pilot.mode.name != "RTL":
            pilot.enter(pilot.modes["RTL"])
            pilot.out.append(heartbeat(pilot))

    def _battery_failed(self, text: str) -> None:
        """Act by BATT_FS_LOW_ACT."""
        self._pilot.say(WARNING, text)
        self._act(int(self._pilot.params["BATT_FS_LOW_ACT"]))

    def _broke_fence(self) -> None:
        """Act by FENCE_ACTION."""
        self._pilot.say(WARNING, "Fence Breached")
        self._act(int(self._pilot.params["FENCE_ACTION"]))
