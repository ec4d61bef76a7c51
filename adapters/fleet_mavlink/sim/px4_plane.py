"""PX4 1.16.1 with wings, as recorded: runway take-off, circles, landing at the present position."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.autopilot import Autopilot, CommandHandler
from fleet_mavlink.sim.command_request import (
    ACCEPTED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    CommandRequest,
    whole,
)
from fleet_mavlink.sim.local_frame import Geo
from fleet_mavlink.sim.manoeuvres import TAKING_OFF, Idle, Manoeuvre
from fleet_mavlink.sim.message_output import CRITICAL, INFO
from fleet_mavlink.sim.modes import FlightMode
from fleet_mavlink.sim.parts import Parts
from fleet_mavlink.sim.physics import Agility
from fleet_mavlink.sim.plane_mission import WingedMission
from fleet_mavlink.sim.plane_moves import CircleDown, CircleManoeuvre, RunwayTakeoff
from fleet_mavlink.sim.px4 import SimPx4
from fleet_mavlink.sim.px4_commands import COMMANDS as COPTERS
from fleet_mavlink.sim.px4_modes import MODES as COPTER_MODES
from fleet_mavlink.sim.px4_offboard import Px4Offboard
from fleet_mavlink.sim.px4_takeoff import Px4LandDetector, Px4Takeoff, Px4TakeoffControl
from fleet_mavlink.sim.setpoints import ReceivedSetpoint
from fleet_mavlink.sim.speeds import Px4Speeds

_LOW = 3.0  # m below its height at which it circles for a long time
_PASSES = 25.0  # m from a position
_DETECTED_AT = 6.0  # m/s of ground roll
_LANDINGS = frozenset({mav.MAV_CMD_NAV_LAND, mav.MAV_CMD_NAV_VTOL_LAND})
_NEEDS_LANDING = frozenset({2, 3, 4})  # MIS_TKO_LAND_REQ


class Px4PlaneSpeeds(Px4Speeds):
    """Speeds by FW_*."""

    @property
    def cruise(self) -> float:
        """FW_AIRSPD_TRIM, or the requested speed."""
        return self.requested or self._params["FW_AIRSPD_TRIM"]

    @property
    def climb(self) -> float:
        """FW_T_CLMB_R_SP."""
        return self._params["FW_T_CLMB_R_SP"]

    @property
    def sink(self) -> float:
        """FW_T_SINK_R_SP."""
        return self._params["FW_T_SINK_R_SP"]

    @property
    def takeoff(self) -> float:
        """The usual climb rate."""
        return self.climb

    @property
    def landing(self) -> tuple[float, float, float]:
        """1.3 m/s in circles, as observed."""
        return 1.3, 1.3, 0.0


def circle_here(pilot: Autopilot) -> Manoeuvre:
    """Return the circle around the present position."""
    body = pilot.body
    if body.grounded:
        return Idle()
    return CircleManoeuvre(body.north, body.east, body.down, pilot.params["NAV_LOITER_RAD"])


def _land(pilot: Autopilot) -> Manoeuvre:
    if pilot.body.grounded:
        return Idle()
    return CircleDown(pilot, pilot.params["NAV_LOITER_RAD"])


def _home(pilot: Autopilot) -> Manoeuvre:
    """Circle over home, at RTL_RETURN_ALT or at the present height if that is greater."""
    if pilot.body.grounded:
        return Idle()
    north, east, down = pilot.home.ned()
    lowest = min(pilot.body.down, down - pilot.params["RTL_RETURN_ALT"])
    return CircleManoeuvre(north, east, lowest, pilot.params["NAV_LOITER_RAD"])


_ENTERED = {
    "LOITER": circle_here,
    "OFFBOARD": circle_here,
    "POSCTL": circle_here,
    "ORBIT": circle_here,
    "MISSION": WingedMission,
    "RTL": _home,
    "LAND": _land,
    "PRECLAND": _land,
}
MODES = {
    name: replace(mode, enter=_ENTERED[name]) if name in _ENTERED else mode
    for name, mode in COPTER_MODES.items()
}


def _reposition(pilot: SimPx4Plane, request: CommandRequest) -> int:
    """Circle a position; NaN keeps a value; the radius in param 3 is ignored."""
    if not whole(request.p2) & 1:
        return UNSUPPORTED
    return pilot.go((request.latitude, request.longitude, request.altitude), request.p1)


def _altitude(pilot: SimPx4Plane, request: CommandRequest) -> int:
    return pilot.go((math.nan, math.nan, request.p1), -1.0)


def _start_mission(pilot: SimPx4Plane, request: CommandRequest) -> int:
    """Refuse a mission without a landing, unless MIS_TKO_LAND_REQ permits it."""
    landing = any(item.command in _LANDINGS for item in pilot.missions.items)
    if int(pilot.params["MIS_TKO_LAND_REQ"]) in _NEEDS_LANDING and not landing:
        pilot.say(CRITICAL, "Mission rejected: Landing waypoint/pattern required")
        pilot.say(CRITICAL, "Mission start denied! No valid mission")
        return TEMPORARILY_REJECTED
    return COPTERS[mav.MAV_CMD_MISSION_START](pilot, request) or ACCEPTED


COMMANDS: Mapping[int, CommandHandler] = {
    **COPTERS,
    mav.MAV_CMD_DO_REPOSITION: _reposition,
    mav.MAV_CMD_DO_CHANGE_ALTITUDE: _altitude,
    mav.MAV_CMD_MISSION_START: _start_mission,
}


class RunwayTakeoffControl(Px4TakeoffControl):
    """Take-off of one PX4 fixed wing from a runway."""

    def _fly(self, requested: Manoeuvre) -> None:
        """Roll along the nose and climb to the requested height; circle in the air."""
        pilot = self._pilot
        if isinstance(requested, Px4Takeoff) and pilot.body.grounded:
            pilot.say(INFO, "Takeoff on runway")
            pilot.manoeuvre = RunwayTakeoff(pilot.frame.down_of(requested.altitude))
        elif isinstance(requested, Px4Takeoff):
            pilot.enter(pilot.modes["LOITER"])
        else:
            pilot.manoeuvre = requested


class RunwayLandDetector(Px4LandDetector):
    """Land detector of one PX4 fixed wing."""

    @property
    def landed(self) -> bool:
        """True on the ground, until its roll is detected as a take-off."""
        body = self._pilot.body
        return body.grounded and not (self._takes_off and body.speed > _DETECTED_AT)

    def state(self) -> int:
        """Return TAKEOFF until its height is reached."""
        return TAKING_OFF if self._takes_off and not self.landed else super().state()

    @property
    def _takes_off(self) -> bool:
        """True during a take-off from a runway."""
        return isinstance(self._pilot.manoeuvre, RunwayTakeoff)


class Px4PlaneOffboard(Px4Offboard):
    """OFFBOARD of one PX4 fixed wing: accepted without effect."""

    def manoeuvre(self, setpoint: ReceivedSetpoint) -> Manoeuvre:  # noqa: ARG002 - it has no effect
        """Keep the present manoeuvre."""
        return self._pilot.manoeuvre


class SimPx4Plane(SimPx4):
    """PX4 fixed wing."""

    vehicle_type: ClassVar[int] = int(mav.MAV_TYPE_FIXED_WING)
    commands: ClassVar[Mapping[int, CommandHandler]] = COMMANDS
    modes: ClassVar[Mapping[str, FlightMode]] = MODES
    parts: ClassVar[Parts] = replace(
        SimPx4.parts, speeds=Px4PlaneSpeeds, setpoints=Px4PlaneOffboard, land_detector=RunwayLandDetector
    )
    takeoff_control: ClassVar[type[Px4TakeoffControl]] = RunwayTakeoffControl
    agility: ClassVar[Agility] = Agility(4.0, 3.0, 1.0)
    _detected: Manoeuvre | None = None  # the last take-off that was reported

    @property
    def circle_radius(self) -> float:
        """NAV_LOITER_RAD."""
        return self.params["NAV_LOITER_RAD"]

    @property
    def passes_within(self) -> float:
        """Distance at which it turns to the next position."""
        return _PASSES

    def enter(self, mode: FlightMode) -> None:
        """Change to a mode, as flown with wings; HOLD keeps the present circle."""
        flown = self.manoeuvre
        super().enter(self.modes[mode.name])
        if mode.name == "LOITER" and isinstance(flown, CircleManoeuvre) and not isinstance(flown, CircleDown):
            self.manoeuvre = flown

    def go(self, place: Geo, speed: float) -> int:
        """Change to LOITER around a position; NaN keeps a value."""
        result = self.change_mode(self.modes["LOITER"])
        if result != ACCEPTED or not self.flying or not self.armed:
            return result
        wanted = [new if math.isfinite(new) else now for new, now in zip(place, self.geo(), strict=True)]
        north, east, down = self.frame.ned_of(*wanted)
        self.manoeuvre = CircleManoeuvre(
            north, east, down + _LOW, self.circle_radius, speed if speed > 0.0 else None
        )
        return ACCEPTED

    def supervise(self) -> None:
        """Change to LOITER at the end of a take-off."""
        flown = self.manoeuvre
        if isinstance(flown, RunwayTakeoff):
            if not self.land_detector.landed and self._detected is not flown:
                self._detected = flown
                self.say(INFO, "Takeoff detected")
            if flown.done:
                self.enter(self.modes["LOITER"])
        super().supervise()
