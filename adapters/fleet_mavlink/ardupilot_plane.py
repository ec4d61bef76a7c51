"""ArduPlane, also with lifting rotors (QuadPlane): mode numbers and behaviour of version 4.6."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

from fleet import GeoOrigin, GeoPoint, NotReady, Refused, Vector3, Velocity, geo_from_world
from fleet_mavlink.ardupilot_flavour import ArduPilotFlavour
from fleet_mavlink.constants import NAN, VTOL_GOES_FORWARD, VTOL_HOVERS, MavCmd, MavFrame, mode_names
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.messages import CommandInt, CommandLong, MavlinkCommand
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle_kind import Brake
from fleet_mavlink.vocabulary import HOVERING, NO_VELOCITIES, UNSET_QUADPLANE
from fleet_mavlink.wings import Winged

GUIDED_HOVERS, _ASSIST, _CRUISE = "Q_GUIDED_MODE", "Q_ASSIST_SPEED", "AIRSPEED_CRUISE"
_ABOVE_ASSIST = 2.0  # m/s
_BY_ROTORS = frozenset({"QSTABILIZE", "QHOVER", "QLOITER", "QLAND", "QRTL", "QAUTOTUNE", "QACRO"})
_CHANGE_MODE = 1.0  # param2 of DO_REPOSITION
_DECELERATION, _BRAKING = "Q_TRANS_DECEL", 2.0  # of a QuadPlane to its hover, m/s2; assumed until it is known
_HARDER = 1.25  # times Q_TRANS_DECEL: how hard it brakes from its wings without passing its target
_NEAR = 0.9 * 1.5  # stopping distances from cruise airspeed: it certainly hovers to nearer positions
_PULLED, _PULLS = 8.0, 3.2  # distance (m, plus s at its speed) covered after a transition is aborted
_SLOWED = 0.9  # share of the speed of its wings, after the 3 s for which a stop is observed
_FRESH = 1.5  # s: largest age difference between position and heartbeat
_FASTEST_HOVER = 10.0  # m/s; a faster vehicle flies on its wings, or slows down from them
_FASTEST_CRUISE = 30.0  # m/s, assumed until it is known


def reposition(to: GeoPoint) -> CommandInt:
    """Return DO_REPOSITION to a position (altitude AMSL), which changes to GUIDED and is acknowledged."""
    return CommandInt(
        MavCmd.DO_REPOSITION,
        frame=MavFrame.GLOBAL_INT,
        param1=-1.0,
        param2=_CHANGE_MODE,
        param4=NAN,
        x=round(to.latitude * 1e7),
        y=round(to.longitude * 1e7),
        z=to.altitude,
    )


class _ArduPlaneModes(ArduPilotFlavour):
    """Modes of ArduPlane, with or without rotors."""

    modes: ClassVar[Mapping[int, str]] = mode_names(
        "PLANE_MODE", {5: "FBWA", 6: "FBWB", 16: "INITIALISING", 25: "LOITER2QLAND"}
    )
    tries_brakes: ClassVar[bool] = True
    mission_ends: ClassVar[tuple[str, ...]] = ("RTL", "QRTL")
    lands_once: ClassVar[str] = "In landing sequence"

    @property
    def failsafe_table(self) -> str:
        """Table of fail-safe parameters of planes."""
        return "arduplane"

    def goes_on(self, speed: float, state: VehicleState) -> float:
        """Return the stopping distance, m; without known rotors limited to the speed of a hover.

        A QuadPlane that is sent nearer passes its target, turns its nose, brakes less, and flies back. To
        a place beyond ``_NEAR`` it would fly on its wings.
        """
        hovers = min(speed, _FASTEST_HOVER) * speed / (2 * _BRAKING)
        slows = state.settings.get(_DECELERATION, _BRAKING if state.vtol_state else 0.0)
        if not slows:
            return hovers
        near = _NEAR * state.settings.get(_CRUISE, _FASTEST_CRUISE) ** 2 / (2 * slows)
        return min(max(hovers, speed**2 / (2 * _HARDER * slows)), near)

    def to_stand(self, here: GeoPoint, state: VehicleState) -> CommandInt:
        """Return the command to its stopping point."""
        velocity = state.velocity
        speed = velocity.horizontal() if velocity is not None else 0.0
        if velocity is None or not 0.0 < speed < math.inf:
            return reposition(here)
        seconds = self.goes_on(speed, state) / speed
        ahead = Vector3(velocity.y * seconds, velocity.x * seconds, 0.0)
        return reposition(geo_from_world(GeoOrigin(here.latitude, here.longitude, here.altitude), ahead))

    def go_command(
        self,
        to: GeoPoint,
        home_altitude: float,  # noqa: ARG002 - it takes AMSL
        speed: float,  # noqa: ARG002 - see ``command_after_go``
        heading: float,  # noqa: ARG002 - its nose follows its course
    ) -> CommandInt:
        """Return DO_REPOSITION."""
        return reposition(to)


class ArduPlane(Winged, _ArduPlaneModes):
    """A plane. It takes off in mode TAKEOFF, and circles; LOITER needs a position, CIRCLE does not."""

    hold: ClassVar[str] = "LOITER"
    braking: ClassVar[tuple[str, ...]] = ("LOITER", "CIRCLE")
    land: ClassVar[str] = "AUTO"
    takeoff: ClassVar[str] = "TAKEOFF"
    takeoff_height: ClassVar[str | None] = "TKOFF_ALT"
    lands_here: ClassVar[bool] = False
    circle: ClassVar[str] = "WP_LOITER_RAD"
    airspeeds: ClassVar[tuple[str, str, str]] = ("AIRSPEED_MIN", _CRUISE, "AIRSPEED_MAX")

    @property
    def settings(self) -> tuple[str, ...]:
        """Parameters that it needs for moving; a plane without lifting rotors has no Q_GUIDED_MODE."""
        return (GUIDED_HOVERS, *super().settings, "TKOFF_ALT")  # the one that a stop needs comes first

    def takeoff_command(self, altitude: float, home_altitude: float) -> CommandLong:  # noqa: ARG002
        """Return the change to TAKEOFF, which climbs to TKOFF_ALT: NAV_TAKEOFF is for rotors."""
        return self.mode_command(self.takeoff)

    def comes_down(self, state: VehicleState) -> bool:
        """Return True while it flies home; a landing has the mode of any mission."""
        return self.mode_of(state) == self.return_home

    def land_command(self) -> CommandLong:
        """Return DO_LAND_START: it follows the landing in its mission, and is refused without one."""
        return CommandLong(MavCmd.DO_LAND_START)

    def command_after_go(self, speed: float, state: VehicleState) -> CommandLong | None:  # noqa: ARG002 - always the same
        """Return DO_CHANGE_SPEED for an airspeed."""
        return CommandLong(MavCmd.DO_CHANGE_SPEED, param1=self.speed_kind, param2=speed, param3=-1.0)


class UnknownArduPlane(ArduPlane):
    """A plane that has not yet reported whether it has rotors, or flies on them.

    GUIDED is right for all: a plane circles, and a QuadPlane hovers if its parameters permit it. But GUIDED
    has no effect on a vehicle that is in GUIDED already, on its way to a position: LOITER must come first
    then.
    """

    hold: ClassVar[str] = "GUIDED"

    def hold_command(self, state: VehicleState) -> MavlinkCommand:
        """Return the change to GUIDED."""
        return self.brakes(state)[0].request

    def brakes(self, state: VehicleState) -> tuple[Brake, ...]:
        """Return GUIDED, or a landing if it hovers and GUIDED would not; then the circling modes."""
        circles = super().brakes(state)
        mode, here = self.mode_of(state), _here(state)
        if mode in _BY_ROTORS and not state.settings.get(GUIDED_HOVERS):
            best = Brake("QLAND", self.mode_command("QLAND"))
        elif mode != "GUIDED":
            best = Brake("GUIDED", self.mode_command("GUIDED"))
        elif here is not None:
            best = Brake("GUIDED", self.to_stand(here, state))
        else:
            best = Brake("GUIDED", self.mode_command("GUIDED"), first=circles[0])
        return (best, *circles)


class _Assisted(ArduPlane):
    """A QuadPlane on its wings: near Q_ASSIST_SPEED its rotors assist, and it changes back and forth."""

    def airspeed(self, state: VehicleState, limit: float | None, wanted: float | None) -> float:
        """Return the airspeed to fly at, m/s; raises Refused for one at which its rotors would assist."""
        speed, helped = super().airspeed(state, limit, wanted), state.settings.get(_ASSIST, 0.0)
        if helped > 0.0 and speed < helped + _ABOVE_ASSIST:
            raise Refused(
                f"at {speed:g} m/s its rotors help (Q_ASSIST_SPEED {helped:g}), and it is faster",
                hint=f"give it at least {helped + _ABOVE_ASSIST:g} m/s, or a lower Q_ASSIST_SPEED",
            )
        return speed


_PLANE, _UNKNOWN, _WINGS = ArduPlane(), UnknownArduPlane(), _Assisted()


class QuadPlane(_ArduPlaneModes):
    """A QuadPlane in hover. It holds in GUIDED; QLOITER without a pilot's stick sinks at 2.5 m/s.

    GUIDED has no effect while it flies to a position, so it is sent to its stopping point instead.
    """

    hold: ClassVar[str] = "GUIDED"
    land: ClassVar[str] = "QLAND"
    return_home: ClassVar[str] = "QRTL"
    tolerance: ClassVar[float] = 1.5
    forward: ClassVar[Flavour | None] = _WINGS
    speed_kind: ClassVar[float] = _PLANE.speed_kind  # a ground speed would only be a lower limit
    passes: ClassVar[float] = _PLANE.passes
    transitions: ClassVar[Mapping[str, str]] = {"forward": "LOITER", "hover": "GUIDED"}
    lacking: ClassVar[Mapping[str, str]] = HOVERING

    @property
    def settings(self) -> tuple[str, ...]:
        """Parameters of its wings, of its behaviour in GUIDED, and its speeds."""
        return (*_PLANE.settings, "Q_WP_SPEED", _DECELERATION, _ASSIST)

    @property
    def failsafe_table(self) -> str:
        """Table of fail-safe parameters: those of planes, and Q_GUIDED_MODE."""
        return "quadplane"

    def cannot(self, velocity: Velocity, *, turns_in_place: bool | None) -> str:  # noqa: ARG002 - for any
        """Return the reason against every velocity: ArduPlane accepts none."""
        return NO_VELOCITIES

    def stands(self, state: VehicleState) -> bool:
        """Return True while it hovers."""
        return state.vtol_state in VTOL_HOVERS

    def slows_to(self, speed: float) -> float:
        """Return the speed below which it is slowing down; from its wings it takes longer."""
        return _SLOWED * speed if speed > _FASTEST_HOVER else super().slows_to(speed)

    def hold_command(self, state: VehicleState) -> MavlinkCommand:
        """Return the command to its stopping point; without a position QLAND."""
        here = _here(state)
        return self.mode_command(self.land) if here is None else self.to_stand(here, state)

    def brakes(self, state: VehicleState) -> tuple[Brake, ...]:
        """Return the hold, then a landing in case the hold is refused."""
        landing = Brake(self.land, self.mode_command(self.land))
        return (landing,) if _here(state) is None else (Brake(self.hold, self.hold_command(state)), landing)

    def takeoff_command(self, altitude: float, home_altitude: float) -> CommandInt:  # noqa: ARG002
        """Return NAV_TAKEOFF with the rotors, with the height above its present position."""
        return CommandInt(MavCmd.NAV_TAKEOFF, frame=MavFrame.LOCAL_OFFSET_NED, z=-altitude)

    def command_after_go(self, speed: float, state: VehicleState) -> CommandLong | None:
        """Return the command of its wings for an airspeed; in hover Q_WP_SPEED applies."""
        slowest = state.settings.get(_PLANE.airspeeds[0], math.inf)
        return _PLANE.command_after_go(speed, state) if speed >= slowest else None

    def speed_to(
        self, state: VehicleState, limit: float | None, wanted: float | None, metres: float
    ) -> float:
        """Return its airspeed to a far position, Q_WP_SPEED to a near one.

        Raises Refused if it cannot fly that slowly, NotReady before its parameters are known.
        """
        cruise, brakes = (state.settings.get(name) for name in (_CRUISE, _DECELERATION))
        own = state.settings.get("Q_WP_SPEED")
        if cruise is None or not brakes or own is None:
            raise NotReady(
                "its speeds are not known yet", hint="they are read after the vehicle connects; try again"
            )
        near = _NEAR * cruise**2 / (2 * brakes)
        if metres > near:
            try:
                return _WINGS.airspeed(state, limit, wanted)
            except Refused as error:
                reason = f"a goal more than {near:.0f} m away is flown on its wings: {error.reason}"
                raise Refused(reason, hint=error.hint) from error
        most = min(limit or math.inf, wanted or math.inf)
        if metres > self.tolerance and own / 100 > most:
            raise Refused(
                f"in its hover it flies at {own / 100:g} m/s (Q_WP_SPEED), and it may fly at {most:g} m/s",
                hint=f"set Q_WP_SPEED to {most * 100:.0f} or less",
            )
        return own / 100


class QuadPlaneForward(QuadPlane):
    """A QuadPlane on its wings, or on the ground: goals end in hover."""

    hold: ClassVar[str] = "LOITER"
    braking: ClassVar[tuple[str, ...]] = ("LOITER", "CIRCLE")

    def hold_command(self, state: VehicleState) -> MavlinkCommand:  # noqa: ARG002 - independent of the state
        """Return the change to LOITER."""
        return self.mode_command(self.hold)

    def brakes(self, state: VehicleState) -> tuple[Brake, ...]:  # noqa: ARG002 - always the same
        """Return the modes in which it circles."""
        return tuple(Brake(mode, self.mode_command(mode)) for mode in self.braking)


class QuadPlaneInTransition(QuadPlane):
    """A QuadPlane in transition to its wings: a stop aborts the transition, and it hovers.

    Its propeller pulls it on for a while: with a nearer target it goes as far, and flies back.
    """

    goes_over: ClassVar[bool] = True

    def goes_on(self, speed: float, state: VehicleState) -> float:  # noqa: ARG002 - independent of the state
        """Return the distance that ArduPlane 4.6.3 was observed to cover, m."""
        return _PULLED + _PULLS * speed


class UnsetQuadPlane(QuadPlane):
    """A hovering QuadPlane with Q_GUIDED_MODE 0: GUIDED would make it fly forward, so a stop lands it."""

    hold: ClassVar[str] = "QLAND"
    lacking: ClassVar[Mapping[str, str]] = UNSET_QUADPLANE

    def hold_command(self, state: VehicleState) -> MavlinkCommand:  # noqa: ARG002 - independent of the state
        """Return the change to QLAND."""
        return self.mode_command(self.hold)

    def brakes(self, state: VehicleState) -> tuple[Brake, ...]:
        """Return the landing."""
        return (Brake(self.hold, self.hold_command(state)),)


class QuadPlaneWithoutGuidedMode(QuadPlaneForward):
    """A QuadPlane with Q_GUIDED_MODE 0 on its wings, or on the ground."""

    lacking: ClassVar[Mapping[str, str]] = UNSET_QUADPLANE


class UnsetQuadPlaneInTransition(UnsetQuadPlane):
    """A QuadPlane with Q_GUIDED_MODE 0 in transition to its wings: a stop aborts that, and lands it."""

    goes_over: ClassVar[bool] = True


_HOVER, _FORWARD, _IN_TRANSITION = QuadPlane(), QuadPlaneForward(), QuadPlaneInTransition()
_UNSET_HOVER, _UNSET_FORWARD = UnsetQuadPlane(), QuadPlaneWithoutGuidedMode()
_UNSET_IN_TRANSITION = UnsetQuadPlaneInTransition()
_QUADPLANES: Mapping[int, tuple[Flavour, Flavour]] = {
    VTOL_GOES_FORWARD: (_IN_TRANSITION, _UNSET_IN_TRANSITION),
    **dict.fromkeys(VTOL_HOVERS, (_HOVER, _UNSET_HOVER)),
}
"""MAV_VTOL_STATE -> flavour if GUIDED hovers, flavour if not."""


def arduplane_of(state: VehicleState) -> Flavour:
    """Return the present flavour of an ArduPlane: by its rotors, its flight state, and Q_GUIDED_MODE."""
    if state.vtol_state is None:
        return _UNKNOWN
    if not state.vtol_state:
        return _PLANE
    set_up, unset = _QUADPLANES.get(state.vtol_state, (_FORWARD, _UNSET_FORWARD))
    return set_up if _hovers_in_guided(state) else unset


def _hovers_in_guided(state: VehicleState) -> bool:
    """Return whether GUIDED hovers: by its parameter, or while that is unknown, by observation."""
    setting = state.settings.get(GUIDED_HOVERS)
    if setting is not None:
        return bool(setting)
    return state.vtol_state in VTOL_HOVERS and _PLANE.mode_of(state) == "GUIDED"


def _here(state: VehicleState) -> GeoPoint | None:
    """Return its position; None if it is too old as a target: a stop would fly it back."""
    return None if state.heartbeat_at - state.position_at > _FRESH else state.position
