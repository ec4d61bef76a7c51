"""ArduPlane 4.6.3 with lifting rotors (QuadPlane): its Q modes, and GUIDED by Q_GUIDED_MODE."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.autopilot import Autopilot, Boot, CommandHandler
from fleet_mavlink.sim.manoeuvres import GoToManoeuvre, Idle, Land, Manoeuvre, Return, Sink
from fleet_mavlink.sim.message_output import INFO
from fleet_mavlink.sim.modes import GUIDED_BASE, FlightMode
from fleet_mavlink.sim.parts import Parts
from fleet_mavlink.sim.plane import MODES as PLANE_MODES
from fleet_mavlink.sim.plane import PlaneArming, PlaneLandDetector, PlaneSpeeds, SimArduPlane
from fleet_mavlink.sim.plane_moves import Ahead, CircleManoeuvre, FlyOver
from fleet_mavlink.sim.plane_physics import WING_SPEED, VtolBody
from fleet_mavlink.sim.quadplane_commands import COMMANDS
from fleet_mavlink.sim.speeds import ArduPilotSpeeds, FlightSpeeds
from fleet_mavlink.sim.vtol_mission import VtolMission

TO_FORWARD, TO_HOVER, HOVERS, FORWARD = 1, 2, 3, 4  # MAV_VTOL_STATE
_FORWARD_TAKES = 8.0  # s
_HARDER = 1.25  # times Q_TRANS_DECEL: its largest deceleration from its wings
_NEAR = 1.5  # stopping distances from cruise airspeed, up to which it hovers to a position
_HELPS, _PUSHED = 1.0, 2.0  # m/s above Q_ASSIST_SPEED: when its rotors assist, and its speed then
_TAKEOFFS, _NAV_LAST = frozenset({mav.MAV_CMD_NAV_TAKEOFF, mav.MAV_CMD_NAV_VTOL_TAKEOFF}), 95
_STICK_AT_MINIMUM = 2.5  # m/s down
_LANDED_DISARM = 2.0  # s
_RTL_HEIGHT = 15.0  # m, Q_RTL_ALT


def _sink(pilot: Autopilot) -> Manoeuvre:
    """Sink: an absent pilot's stick counts as being at its minimum."""
    return Idle() if pilot.body.grounded else Sink(_STICK_AT_MINIMUM)


def _home(pilot: Autopilot) -> Manoeuvre:
    return Return(pilot, _RTL_HEIGHT, 0.0)


_BY_ROTORS = (
    FlightMode("QHOVER", 18, _sink, GUIDED_BASE, position=False),
    FlightMode("QLOITER", 19, _sink, GUIDED_BASE),
    FlightMode("QLAND", 20, Land, GUIDED_BASE, armable=False),
    FlightMode("QRTL", 21, _home, GUIDED_BASE, armable=False),
)
_AUTO = replace(PLANE_MODES["AUTO"], enter=VtolMission)
MODES = {**PLANE_MODES, **{mode.name: mode for mode in (_AUTO, *_BY_ROTORS)}}


class HoverSpeeds(ArduPilotSpeeds):
    """Q_WP_SPEED, and the climb of a copter."""

    @property
    def cruise(self) -> float:
        """Q_WP_SPEED, whatever is requested."""
        return self._params["Q_WP_SPEED"] / 100


class AssistedSpeeds(PlaneSpeeds):
    """Speeds of a plane, but its rotors keep it faster than Q_ASSIST_SPEED."""

    @property
    def cruise(self) -> float:
        """The requested speed, raised near Q_ASSIST_SPEED."""
        requested, helped = super().cruise, self._params["Q_ASSIST_SPEED"]
        return helped + _PUSHED if requested < helped + _HELPS else requested


class QuadPlaneArming(PlaneArming):
    """Arming checks of one QuadPlane."""

    def refusals(self, *, force: bool) -> list[str]:
        """Return the refusals, also in AUTO for a mission that does not begin with a take-off."""
        pilot = self._pilot
        begins = next((item.command for item in pilot.missions.items[1:] if item.command < _NAV_LAST), None)
        missing = pilot.mode.name == "AUTO" and begins not in _TAKEOFFS and not force
        return super().refusals(force=force) + ["AUTO missing takeoff waypoint"] * missing


class QuadPlaneLandDetector(PlaneLandDetector):
    """Land detector of one QuadPlane."""

    def __init__(self, pilot: SimQuadPlane) -> None:
        super().__init__(pilot)
        self._has_landed = False  # since it started

    def state(self) -> int:
        """Return in the air also where it stands armed in GUIDED, once it has landed with its rotors."""
        pilot = self._pilot
        if self._has_landed and pilot.armed and pilot.mode.name == "GUIDED":
            return int(mav.MAV_LANDED_STATE_IN_AIR)
        return super().state()

    def touch_down(self) -> None:
        """Remember it."""
        self._has_landed = True
        super().touch_down()


class SimQuadPlane(SimArduPlane):
    """ArduPlane with Q_ENABLE 1."""

    commands: ClassVar[Mapping[int, CommandHandler]] = COMMANDS
    modes: ClassVar[Mapping[str, FlightMode]] = MODES
    parts: ClassVar[Parts] = replace(
        SimArduPlane.parts, arming=QuadPlaneArming, land_detector=QuadPlaneLandDetector
    )
    body: VtolBody

    def __init__(self, boot: Boot) -> None:
        self._goes_over: tuple[float, Manoeuvre] | None = None  # end of the transition, next manoeuvre
        self._hover: FlightSpeeds = HoverSpeeds(boot.params)
        self._wings: FlightSpeeds = AssistedSpeeds(boot.params)
        super().__init__(boot)
        self.body.hovers = False

    @property
    def airspeeds(self) -> FlightSpeeds:
        """Speeds on its wings."""
        return self._wings

    @property
    def hovers_in_guided(self) -> bool:
        """Q_GUIDED_MODE."""
        return bool(self.params["Q_GUIDED_MODE"])

    @property
    def slows_within(self) -> float:
        """Its stopping distance from its cruise airspeed, m."""
        return float(self.params["AIRSPEED_CRUISE"] ** 2 / (2 * self.params["Q_TRANS_DECEL"]))

    def vtol_state(self) -> int:
        """Return its flight state; forward on the ground, too."""
        if self._goes_over is not None:
            return TO_FORWARD
        if not self.body.hovers:
            return FORWARD
        return TO_HOVER if self.body.speed > WING_SPEED else HOVERS

    def hover(self) -> None:
        """Hover from now on; from the speed of its wings it slows down by Q_TRANS_DECEL."""
        self._goes_over = None
        self.body.slows = _HARDER * self.params["Q_TRANS_DECEL"]
        self.body.hovers, self.speeds = True, self._hover

    def _to_stand(self) -> GoToManoeuvre:
        """Return the manoeuvre to its stopping point by Q_TRANS_DECEL."""
        body = self.body
        seconds = body.speed / (2 * self.params["Q_TRANS_DECEL"])
        return GoToManoeuvre(body.north + body.vn * seconds, body.east + body.ve * seconds, body.down)

    def go_forward(self, then: Manoeuvre) -> None:
        """Begin the transition to forward flight, along its nose."""
        self.say(INFO, "Transition started airspeed 0.2")
        self._goes_over = (self.time + _FORWARD_TAKES, then)
        self.manoeuvre = Ahead(self.body.down)

    def go_to(self, north: float, east: float, down: float) -> None:
        """Hover to a position; to a far one on its wings."""
        body = self.body
        near = _NEAR * self.slows_within
        if math.hypot(north - body.north, east - body.east) <= near:
            self.hover()
            self.manoeuvre = GoToManoeuvre(north, east, down)
            return
        approach = FlyOver(north, east, down, self.slows_within)
        if body.hovers:
            self.go_forward(approach)
        else:
            self.manoeuvre = approach

    def enter(self, mode: FlightMode) -> None:
        """Change to a mode; Q modes, and GUIDED by its parameter, hover; the others fly forward."""
        again = mode is self.mode and mode.name == "GUIDED"
        super().enter(mode)
        if again or not (self.armed and self.flying):
            return
        if mode in _BY_ROTORS:
            self.hover()
        elif mode.name == "GUIDED" and self.hovers_in_guided:
            self.hover()
            self.manoeuvre = self._to_stand()
        elif self.body.hovers:
            self.go_forward(self.manoeuvre)

    def disarm(self) -> None:
        """Stop the motors."""
        super().disarm()
        self.body.hovers, self.speeds = False, self._wings

    def supervise(self) -> None:
        """End a transition, and the approach to a position."""
        if self._goes_over is not None and self.time >= self._goes_over[0]:
            then = self._goes_over[1]
            self._goes_over = None
            self.say(INFO, "Transition done")
            self.body.hovers, self.speeds = False, self._wings
            self.manoeuvre = (
                CircleManoeuvre(self.body.north, self.body.east, self.body.down, self.circle_radius)
                if isinstance(then, CircleManoeuvre)
                else then
            )
        flown = self.manoeuvre
        if self.mode.name == "GUIDED" and isinstance(flown, FlyOver) and flown.done:
            self.hover()
            self.manoeuvre = GoToManoeuvre(flown.north, flown.east, flown.down)
        super().supervise()

    def watch_idle(self) -> None:
        """Disarm some time after a landing."""
        by_rotors = self.mode in _BY_ROTORS or (self.runs_mission and self.body.hovers)
        touched_at = self.land_detector.touched_at
        if by_rotors and touched_at is not None and self.time - touched_at > _LANDED_DISARM:
            self.say(INFO, "Throttle disarmed")
            self.disarm()
        else:
            super().watch_idle()
