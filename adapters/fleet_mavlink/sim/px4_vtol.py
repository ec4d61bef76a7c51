"""PX4 1.16.1 as a standard VTOL, as recorded: a multirotor in hover, a plane on its wings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.autopilot import Boot, CommandHandler
from fleet_mavlink.sim.command_request import ACCEPTED, DENIED, CommandRequest, whole
from fleet_mavlink.sim.local_frame import Geo
from fleet_mavlink.sim.manoeuvres import GoToManoeuvre, Manoeuvre
from fleet_mavlink.sim.modes import FlightMode
from fleet_mavlink.sim.parts import Parts
from fleet_mavlink.sim.plane_moves import Ahead
from fleet_mavlink.sim.plane_physics import VtolBody
from fleet_mavlink.sim.px4 import SimPx4
from fleet_mavlink.sim.px4_arming import Px4Arming
from fleet_mavlink.sim.px4_modes import MODES as COPTER_MODES
from fleet_mavlink.sim.px4_offboard import Px4Offboard
from fleet_mavlink.sim.px4_plane import COMMANDS as PLANES
from fleet_mavlink.sim.px4_plane import MODES as PLANE_MODES
from fleet_mavlink.sim.px4_plane import Px4PlaneSpeeds, SimPx4Plane
from fleet_mavlink.sim.px4_takeoff import Px4TakeoffControl
from fleet_mavlink.sim.setpoints import ReceivedSetpoint
from fleet_mavlink.sim.speeds import FlightSpeeds, Px4Speeds
from fleet_mavlink.sim.vtol_mission import HoverMission, VtolMission

TO_FORWARD, TO_HOVER, HOVERS, FORWARD = 1, 2, 3, 4  # MAV_VTOL_STATE
_TAKES = {FORWARD: 3.1, HOVERS: 0.9}  # s
_BY_ROTORS = frozenset({"LAND", "PRECLAND", "RTL"})
_SLOWS_WITHIN = 40.0  # m
_HOVER_MODES = COPTER_MODES | {"MISSION": replace(COPTER_MODES["MISSION"], enter=HoverMission)}


def _transition(pilot: SimPx4Vtol, request: CommandRequest) -> int:
    """Begin it; on the ground it is done at once, and it cannot be armed on its wings then."""
    to = whole(request.p1)
    if to not in _TAKES:
        return DENIED
    pilot.begin_transition(to)
    return ACCEPTED


class Px4VtolArming(Px4Arming):
    """Arming checks of one PX4 VTOL."""

    def __init__(self, pilot: SimPx4Vtol) -> None:
        super().__init__(pilot)
        self._body = pilot.body

    def refusals(self, *, force: bool) -> list[str]:
        """Return the refusals, also for standing on the ground in its forward flight state."""
        on_wings = [] if self._body.hovers else ["Resolve system health failures first"]
        return super().refusals(force=force) or on_wings


class Px4VtolOffboard(Px4Offboard):
    """OFFBOARD of one PX4 VTOL: without effect on its wings."""

    def __init__(self, pilot: SimPx4Vtol) -> None:
        super().__init__(pilot)
        self._body = pilot.body

    def manoeuvre(self, setpoint: ReceivedSetpoint) -> Manoeuvre:
        """Follow it in hover."""
        return super().manoeuvre(setpoint) if self._body.hovers else self._pilot.manoeuvre


class SimPx4Vtol(SimPx4Plane):
    """PX4 standard VTOL."""

    vehicle_type: ClassVar[int] = 22  # MAV_TYPE_VTOL_FIXEDROTOR, which has another name here
    commands: ClassVar[Mapping[int, CommandHandler]] = {**PLANES, mav.MAV_CMD_DO_VTOL_TRANSITION: _transition}
    modes: ClassVar[Mapping[str, FlightMode]] = PLANE_MODES | {
        "MISSION": replace(PLANE_MODES["MISSION"], enter=VtolMission)
    }
    parts: ClassVar[Parts] = replace(SimPx4.parts, arming=Px4VtolArming, setpoints=Px4VtolOffboard)
    takeoff_control: ClassVar[type[Px4TakeoffControl]] = SimPx4.takeoff_control
    agility = SimPx4.agility
    slows_within: ClassVar[float] = _SLOWS_WITHIN
    body: VtolBody

    def __init__(self, boot: Boot) -> None:
        self._goes_over: tuple[float, int] | None = None  # end and target state of the transition
        self._hover: FlightSpeeds = Px4Speeds(boot.params)
        self._wings: FlightSpeeds = Px4PlaneSpeeds(boot.params)
        super().__init__(boot)
        self.speeds = self._hover

    @property
    def _leaves(self) -> bool:
        """Whether it is in transition to its wings: it flies straight ahead, whatever its target."""
        return self._goes_over is not None and self._goes_over[1] == FORWARD

    def vtol_state(self) -> int:
        """Return its flight state, or its transition."""
        if self._goes_over is not None:
            return TO_FORWARD if self._leaves else TO_HOVER
        return HOVERS if self.body.hovers else FORWARD

    def hover(self) -> None:
        """Begin the transition to hover."""
        self.begin_transition(HOVERS)

    def begin_transition(self, to: int) -> None:
        """Begin a transition, along its nose, in its mode. One to its wings can be aborted at once."""
        if (to == HOVERS) is self.body.hovers and self._goes_over is None:
            return
        if not self.flying or (to == HOVERS and self._leaves):
            self._fly_so(to)
            return
        self._goes_over = (self.time + _TAKES[to], to)
        if to == FORWARD:
            self.manoeuvre = Ahead(self.body.down)

    def _fly_so(self, to: int) -> None:
        """Enter a flight state."""
        self._goes_over = None
        self.body.hovers = to == HOVERS
        self.speeds = self._hover if self.body.hovers else self._wings
        if self.armed and self.flying:
            self.enter(self.mode)

    def enter(self, mode: FlightMode) -> None:
        """Change to a mode; it lands, and returns home, with its rotors."""
        if mode.name in _BY_ROTORS:
            self._goes_over = None
            self.body.hovers, self.speeds = True, self._hover
        if self.body.hovers:
            SimPx4.enter(self, _HOVER_MODES[mode.name])
        else:
            super().enter(mode)
        if self._leaves:
            self.manoeuvre = Ahead(self.body.down)

    def go(self, place: Geo, speed: float) -> int:
        """Fly there in its present flight state."""
        if not self.body.hovers:
            return super().go(place, speed)
        result = self.change_mode(self.modes["LOITER"])
        if result == ACCEPTED and self.flying and self.armed:
            wanted = [new if math.isfinite(new) else now for new, now in zip(place, self.geo(), strict=True)]
            still = not any(map(math.isfinite, place))
            if not still and not self._leaves:
                north, east, down = self.frame.ned_of(*wanted)
                self.manoeuvre = GoToManoeuvre(north, east, down, speed=speed if speed > 0.0 else None)
        return result

    def supervise(self) -> None:
        """End a transition when it is due."""
        if self._goes_over is not None and self.time >= self._goes_over[0]:
            self._fly_so(self._goes_over[1])
        SimPx4.supervise(self)
