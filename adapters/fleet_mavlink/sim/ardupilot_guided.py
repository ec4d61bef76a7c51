"""GUIDED of ArduCopter: flight by setpoints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fleet_mavlink.sim.manoeuvres import DriveManoeuvre, GoToManoeuvre, Manoeuvre, place_of, resting
from fleet_mavlink.sim.setpoints import ReceivedSetpoint, SetpointControl, Triple, setpoint_of, turned

if TYPE_CHECKING:
    from fleet_mavlink.sim.ardupilot import ArduPilot

_BODY_FRAMES = frozenset({8, 9})
_OFFSET_FRAMES = frozenset({7, 8, 9})
_RELATIVE_FRAMES = frozenset({3, 6, 10, 11})
_AMSL_FRAMES = frozenset({0, 5})
_STOP = (0.0, 0.0, 0.0)


class ArduPilotGuided(SetpointControl):
    """Flight by setpoints of one ArduCopter."""

    def __init__(self, pilot: ArduPilot) -> None:
        self._pilot = pilot

    def receive(self, message: Any) -> None:
        """Follow a setpoint in GUIDED flight; ignore it silently otherwise.

        On the ground it only ends a take-off that has not left it yet.
        """
        pilot = self._pilot
        if pilot.mode.name == "GUIDED" and pilot.armed:
            manoeuvre = self._manoeuvre(setpoint_of(message))
            if isinstance(manoeuvre, GoToManoeuvre) and pilot.fence.is_outside(place_of(manoeuvre)):
                return  # silently
            pilot.paused = None
            pilot.manoeuvre = manoeuvre if pilot.flying else resting(manoeuvre)

    def _manoeuvre(self, setpoint: ReceivedSetpoint) -> Manoeuvre:
        """Return the manoeuvre; an invalid setpoint stops the vehicle."""
        pilot = self._pilot
        if setpoint.force or not setpoint.finite:
            return DriveManoeuvre(_STOP)
        heading = setpoint.heading
        if heading is not None and setpoint.frame in _BODY_FRAMES:
            heading += pilot.body.heading
        if setpoint.position is not None:
            place = self._place(setpoint.frame, setpoint.position)
            if heading is None and setpoint.turn_rate is not None:
                heading = pilot.body.heading  # a rate of zero keeps the nose
            return GoToManoeuvre(*place, heading=heading) if place is not None else DriveManoeuvre(_STOP)
        known = setpoint.frame in _OFFSET_FRAMES | _RELATIVE_FRAMES | _AMSL_FRAMES | {1}
        if setpoint.velocity is None or not known:
            return DriveManoeuvre(_STOP)
        velocity = setpoint.velocity
        if setpoint.frame in _BODY_FRAMES:
            velocity = turned(velocity, pilot.body.heading)
        until = pilot.time + pilot.params["GUID_TIMEOUT"]
        return DriveManoeuvre(velocity, heading=heading, turn_rate=setpoint.turn_rate, until=until)

    def _place(self, frame: int, position: Triple) -> Triple | None:
        """Return a target as a local position, None for an unsupported frame."""
        pilot = self._pilot
        x, y, z = position
        if frame == 1:
            return position
        if frame in _OFFSET_FRAMES:
            dn, de, dd = turned(position, pilot.body.heading) if frame in _BODY_FRAMES else position
            return pilot.body.north + dn, pilot.body.east + de, pilot.body.down + dd
        if frame in _RELATIVE_FRAMES and pilot.home.place is not None:
            return pilot.frame.ned_of(x, y, z + pilot.home.place[2])
        return pilot.frame.ned_of(x, y, z) if frame in _AMSL_FRAMES else None
