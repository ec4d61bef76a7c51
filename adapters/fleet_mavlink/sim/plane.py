"""ArduPlane 4.6.3: takes off in mode TAKEOFF, circles in GUIDED and LOITER, lands in a mission."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.ardupilot import ArduPilot
from fleet_mavlink.sim.ardupilot_arming import ArduPilotArming
from fleet_mavlink.sim.autopilot import Autopilot, CommandHandler
from fleet_mavlink.sim.land_detector import LandDetector
from fleet_mavlink.sim.manoeuvres import Idle, Manoeuvre
from fleet_mavlink.sim.message_output import INFO
from fleet_mavlink.sim.modes import GUIDED_BASE, MANUAL_BASE, FlightMode
from fleet_mavlink.sim.parts import Parts
from fleet_mavlink.sim.physics import Agility
from fleet_mavlink.sim.plane_commands import COMMANDS
from fleet_mavlink.sim.plane_failsafes import PlaneFailsafes
from fleet_mavlink.sim.plane_mission import WingedMission
from fleet_mavlink.sim.plane_moves import CircleManoeuvre, RunwayTakeoff
from fleet_mavlink.sim.setpoints import SetpointControl
from fleet_mavlink.sim.speeds import ArduPilotSpeeds, FlightSpeeds

_LANDINGS = frozenset({mav.MAV_CMD_NAV_LAND, mav.MAV_CMD_NAV_VTOL_LAND})
_LANDED_DISARM = 20.0  # s, LAND_DISARMDELAY


class PlaneSpeeds(ArduPilotSpeeds):
    """Speeds by AIRSPEED_CRUISE, TECS_CLMB_MAX, TECS_SINK_MIN."""

    @property
    def cruise(self) -> float:
        """AIRSPEED_CRUISE, or the speed of DO_CHANGE_SPEED, at least MIN_GROUNDSPEED (without wind)."""
        return max(self.requested or self._params["AIRSPEED_CRUISE"], self._params["MIN_GROUNDSPEED"])

    @property
    def climb(self) -> float:
        """TECS_CLMB_MAX."""
        return self._params["TECS_CLMB_MAX"]

    @property
    def sink(self) -> float:
        """TECS_SINK_MIN."""
        return self._params["TECS_SINK_MIN"]

    @property
    def landing(self) -> tuple[float, float, float]:
        """The usual sink rate."""
        return self.sink, self.sink, 0.0


def circle_here(pilot: Autopilot) -> Manoeuvre:
    """Return a circle around the present position; idle on the ground."""
    body = pilot.body
    if body.grounded:
        return Idle()
    return CircleManoeuvre(body.north, body.east, body.down, pilot.params["WP_LOITER_RAD"])


def _manual(pilot: Autopilot) -> Manoeuvre:
    return circle_here(pilot)


def _home(pilot: Autopilot) -> Manoeuvre:
    """Circle over home at RTL_ALTITUDE; it does not land."""
    if pilot.body.grounded:
        return Idle()
    north, east, down = pilot.home.ned()
    return CircleManoeuvre(north, east, down - pilot.params["RTL_ALTITUDE"], pilot.params["WP_LOITER_RAD"])


def _take_off(pilot: Autopilot) -> Manoeuvre:
    """Take off to TKOFF_ALT; circle in the air."""
    down = pilot.home.ned()[2] - pilot.params["TKOFF_ALT"]
    return RunwayTakeoff(down) if pilot.body.grounded else circle_here(pilot)


_ALL = (
    FlightMode("MANUAL", 0, _manual, MANUAL_BASE, position=False),
    FlightMode("CIRCLE", 1, circle_here, GUIDED_BASE, position=False),
    FlightMode("FBWA", 5, _manual, MANUAL_BASE, position=False),
    FlightMode("AUTO", 10, WingedMission, GUIDED_BASE),
    FlightMode("RTL", 11, _home, GUIDED_BASE, armable=False),
    FlightMode("LOITER", 12, circle_here, GUIDED_BASE),
    FlightMode("TAKEOFF", 13, _take_off, GUIDED_BASE),
    FlightMode("GUIDED", 15, circle_here, GUIDED_BASE),
    FlightMode("INITIALISING", 16, _manual, GUIDED_BASE, position=False, armable=False),
)
MODES = {mode.name: mode for mode in _ALL}


class PlaneArming(ArduPilotArming):
    """Arming checks of one ArduPlane."""

    def refusals(self, *, force: bool) -> list[str]:
        """Return the refusals, also for a planned landing that RTL must not fly, or that was just flown."""
        pilot = self._pilot
        missions = pilot.missions
        now = missions.items[missions.current] if missions.current < len(missions.items) else None
        landed = now is not None and now.command in _LANDINGS
        planned = any(item.command == mav.MAV_CMD_DO_LAND_START for item in missions.items)
        unused = planned and not pilot.params["RTL_AUTOLAND"] and not force
        found = super().refusals(force=force) + ["DO_LAND_START set and RTL_AUTOLAND disabled"] * unused
        return found + ["In landing sequence"] * (landed and not force)


class NoSetpoints(SetpointControl):
    """No flight by setpoints."""

    def receive(self, message: Any) -> None:
        """Ignore it silently."""


class PlaneLandDetector(LandDetector):
    """Land detector of one ArduPlane."""

    def state(self) -> int:
        """Return on the ground, or in the air: no other states are reported."""
        return int(mav.MAV_LANDED_STATE_ON_GROUND if self.landed else mav.MAV_LANDED_STATE_IN_AIR)


class SimArduPlane(ArduPilot):
    """ArduPlane without lifting rotors."""

    vehicle_type: ClassVar[int] = int(mav.MAV_TYPE_FIXED_WING)
    commands: ClassVar[Mapping[int, CommandHandler]] = COMMANDS
    modes: ClassVar[Mapping[str, FlightMode]] = MODES
    first_mode: ClassVar[str] = "INITIALISING"
    switched_mode: ClassVar[str] = "MANUAL"
    parts: ClassVar[Parts] = replace(
        ArduPilot.parts,
        speeds=PlaneSpeeds,
        arming=PlaneArming,
        setpoints=lambda _pilot: NoSetpoints(),
        failsafes=PlaneFailsafes,
        land_detector=PlaneLandDetector,
    )
    agility: ClassVar[Agility] = Agility(4.0, 3.0, 1.0)

    @property
    def airspeeds(self) -> FlightSpeeds:
        """Speeds on its wings."""
        return self.speeds

    @property
    def circle_radius(self) -> float:
        """WP_LOITER_RAD."""
        return self.params["WP_LOITER_RAD"]

    @property
    def passes_within(self) -> float:
        """WP_RADIUS."""
        return self.params["WP_RADIUS"]

    def supervise(self) -> None:
        """Circle at the end of a take-off; fly home at the end of a mission."""
        super().supervise()
        if self.mode.name == "TAKEOFF" and self.manoeuvre.done and isinstance(self.manoeuvre, RunwayTakeoff):
            self.manoeuvre = circle_here(self)
        if self.armed and self.runs_mission and self.manoeuvre.done and self.flying:
            self.say(INFO, "Mission complete, changing mode to RTL")
            self.change_mode(self.modes["RTL"].custom)

    def enter(self, mode: FlightMode) -> None:
        """Change to a mode; GUIDED again keeps the present target."""
        if mode is self.mode and mode.name == "GUIDED" and self.armed and self.flying:
            return
        super().enter(mode)

    def watch_idle(self) -> None:
        """Disarm some time after a landing."""
        touched_at = self.land_detector.touched_at
        if touched_at is not None and self.time - touched_at > _LANDED_DISARM:
            self.say(INFO, "Throttle disarmed")
            self.disarm()

    def pilot_takes_over(self, mode: FlightMode) -> None:
        """Change to a mode by the switch of the remote control."""
        self.enter(mode)
