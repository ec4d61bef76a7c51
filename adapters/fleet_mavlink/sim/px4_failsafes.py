"""Fail-safes of PX4: loss of setpoints, remote control, station, battery, position or fence."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from fleet_mavlink.sim.event_list import EventMessage, failsafe_event
from fleet_mavlink.sim.message_output import CRITICAL, WARNING
from fleet_mavlink.sim.modes import FlightMode
from fleet_mavlink.sim.px4_modes import MODES

if TYPE_CHECKING:
    from fleet_mavlink.sim.px4 import SimPx4

_GCS_GRACE = 2.2  # s in addition to COM_DL_LOSS_T
_ACTIONS = {1: "LOITER", 2: "RTL", 3: "LAND"}  # NAV_DLL_ACT, NAV_RCL_ACT
_OFFBOARD_LOSS = {0: "POSCTL", 3: "RTL", 4: "LAND", 5: "LOITER"}  # COM_OBL_RC_ACT
_GOES_DOWN = frozenset({"LAND", "PRECLAND", "RTL"})
_EXCEPTED = {"MISSION": 1, "LOITER": 2, "TAKEOFF": 2, "OFFBOARD": 4}  # mode -> bit of COM_RCL_EXCEPT


class Px4Failsafes:
    """Fail-safes of one PX4. A fail-safe holds first, and acts after COM_FAIL_ACT_T."""

    def __init__(self, pilot: SimPx4) -> None:
        self._pilot = pilot
        self._then: tuple[float, FlightMode] | None = None  # time and mode of the second step
        self._battery_reported: set[str] = set()
        self._events = 0
        self._cause = ""
        self._control_heard_at = -math.inf
        self._control_needed = False  # a remote control that was never there is not missed

    def watch(self) -> None:
        """Check all of them."""
        pilot = self._pilot
        self._hear_control()
        if not pilot.armed or pilot.terminated:
            return
        self._watch_offboard()
        self._watch_position()
        if pilot.flying:
            self._watch_control()
            self._watch_gcs()
        self._watch_battery()
        if pilot.flying:
            pilot.fence.watch(self._broke_fence)
        self._go_on()

    def over(self, *whys: str) -> bool:
        """End the fail-safe, or only one of ``whys`` if given; False if it is another one."""
        if whys and self._pilot.failsafe not in whys:
            return False
        self._pilot.failsafe = ""
        self._then = None
        return True

    def _send_event(self, event: EventMessage) -> None:
        """Send an event, with its sequence number."""
        self._events = (self._events + 1) & 0xFFFF
        event.sequence = self._events
        self._pilot.out.append(event)

    def _fail(self, why: str, mode: str, then: str = "", cause: str = "") -> None:
        """Begin a fail-safe in a mode; ``then`` follows after COM_FAIL_ACT_T seconds."""
        pilot = self._pilot
        pilot.failsafe = why
        pilot.say(CRITICAL, "Failsafe activated")
        seconds = int(pilot.params["COM_FAIL_ACT_T"]) if then else None
        self._send_event(failsafe_event(then or mode, cause or why, seconds=seconds))
        pilot.enter(MODES[mode] if not MODES[mode].position or pilot.has_position else MODES["LAND"])
        self._then = (pilot.time + pilot.params["COM_FAIL_ACT_T"], MODES[then]) if then else None
        self._cause = cause or why

    def _go_on(self) -> None:
        """Execute the second step of a fail-safe."""
        if self._then is not None and self._pilot.time >= self._then[0]:
            _, mode = self._then
            self._then = None
            self._send_event(failsafe_event(mode.name, self._cause))
            self._pilot.enter(mode)

    def _watch_offboard(self) -> None:
        """Act by COM_OBL_RC_ACT when the setpoints stop."""
        pilot = self._pilot
        if pilot.mode.name == "OFFBOARD" and not pilot.setpoints.alive:
            self._fail("offboard", _OFFBOARD_LOSS.get(int(pilot.params["COM_OBL_RC_ACT"]), "LOITER"))

    def _watch_position(self) -> None:
        """Descend without a position; return to the last chosen mode once it is back."""
        pilot = self._pilot
        if pilot.failsafe == "position" and pilot.has_position and self.over("position"):
            pilot.enter(pilot.chosen)
        if pilot.flying and pilot.mode.position and not pilot.has_position and pilot.failsafe != "position":
            self._fail("position", "LAND")

    def _broke_fence(self) -> None:
        """Act by GF_ACTION: 1 only sends the text, 2: hold, 3: return."""
        mode = {2: "LOITER", 3: "RTL"}.get(int(self._pilot.params["GF_ACTION"]))
        self._pilot.say(CRITICAL, "Geofence breached")
        if mode is not None:
            self._fail("fence", mode)

    def _hear_control(self) -> None:
        """Track the remote control; one absent when the motors start is not needed until it returns."""
        pilot = self._pilot
        if pilot.remote_control:
            self._control_heard_at, self._control_needed = pilot.time, True
            self.over("radio")
        elif not pilot.armed:
            self._control_needed = False

    def _watch_control(self) -> None:
        """Act by NAV_RCL_ACT once per loss of the remote control, except in the modes of COM_RCL_EXCEPT."""
        pilot = self._pilot
        silent = pilot.time - self._control_heard_at > pilot.params["COM_RC_LOSS_T"]
        excepted = int(pilot.params["COM_RCL_EXCEPT"]) & _EXCEPTED.get(pilot.mode.name, 0)
        if self._control_needed and silent and not excepted:
            self._control_needed = False
            self._lose("radio", "NAV_RCL_ACT")

    def _watch_gcs(self) -> None:
        """Act by NAV_DLL_ACT when the ground station is silent; nothing by default."""
        pilot = self._pilot
        if pilot.gcs_heard_at is None:
            return
        if pilot.time - pilot.gcs_heard_at > pilot.params["COM_DL_LOSS_T"] + _GCS_GRACE:
            self._lose("gcs", "NAV_DLL_ACT")

    def _lose(self, why: str, parameter: str) -> None:
        """Hold, then act by the parameter; not during a descent, or in another fail-safe."""
        pilot = self._pilot
        action = _ACTIONS.get(int(pilot.params[parameter]))
        if action is not None and not pilot.failsafe and pilot.mode.name not in _GOES_DOWN:
            self._fail(why, "LOITER", then=action)

    def _watch_battery(self) -> None:
        """Warn, then return, then land; once per level."""
        pilot = self._pilot
        share = pilot.battery.percent / 100
        if share < pilot.params["BAT_LOW_THR"] and "low" not in self._battery_reported:
            self._battery_reported.add("low")
            pilot.say(WARNING, "Low battery level, return advised")
        for level, limit, then in (
            ("critical", "BAT_CRIT_THR", "RTL"),
            ("emergency", "BAT_EMERGEN_THR", "LAND"),
        ):
            if share < pilot.params[limit] and level not in self._battery_reported and pilot.flying:
                self._battery_reported.add(level)
                if pilot.params["COM_LOW_BAT_ACT"] > 0:
                    self._fail("battery", "LOITER", then=then, cause=level)
