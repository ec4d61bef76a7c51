"""OFFBOARD of PX4: flight by a stream of setpoints."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from fleet_mavlink.sim.manoeuvres import DriveManoeuvre, GoToManoeuvre, Manoeuvre
from fleet_mavlink.sim.message_output import CRITICAL
from fleet_mavlink.sim.setpoints import ReceivedSetpoint, SetpointControl, Triple, setpoint_of, turned

if TYPE_CHECKING:
    from fleet_mavlink.sim.px4 import SimPx4

_BODY_NED = 8
_LOCAL_NED = 1
_RELATIVE_FRAMES = frozenset({3, 6})
_AMSL_FRAMES = frozenset({0, 5})
_BACK_TO_OFFBOARD = 0.3


class Px4Offboard(SetpointControl):
    """Flight by setpoints of one PX4."""

    def __init__(self, pilot: SimPx4) -> None:
        self._pilot = pilot
        self._setpoint_at: float | None = None
        self._stream_since = 0.0

    @property
    def alive(self) -> bool:
        """True while the last setpoint is younger than COM_OF_LOSS_T."""
        pilot, last = self._pilot, self._setpoint_at
        return last is not None and pilot.time - last <= pilot.params["COM_OF_LOSS_T"]

    def receive(self, message: Any) -> None:
        """Take a setpoint: it keeps the stream alive, and is obeyed in OFFBOARD."""
        pilot = self._pilot
        setpoint = setpoint_of(message)
        if setpoint.heading is not None and math.isnan(setpoint.heading):
            setpoint = replace(setpoint, heading=None)
        refusal = _refusal(setpoint, local=message.get_type() == "SET_POSITION_TARGET_LOCAL_NED")
        if refusal:
            pilot.say(CRITICAL, refusal)
            return
        if not self.alive:
            self._stream_since = pilot.time
        self._setpoint_at = pilot.time
        back = pilot.time - self._stream_since >= _BACK_TO_OFFBOARD
        if back and pilot.failsafes.over("offboard"):
            pilot.enter(pilot.modes["OFFBOARD"])
        if pilot.armed and pilot.mode.name == "OFFBOARD":
            pilot.manoeuvre = self.manoeuvre(setpoint)

    def manoeuvre(self, setpoint: ReceivedSetpoint) -> Manoeuvre:
        """Return the manoeuvre; the heading is kept when the message leaves it out."""
        pilot = self._pilot
        heading = setpoint.heading
        if heading is None and setpoint.turn_rate is None:
            heading = pilot.body.heading
        if setpoint.position is not None and setpoint.frame != _BODY_NED:
            place = self._place(setpoint.frame, setpoint.position)
            return GoToManoeuvre(*place, heading=pilot.body.heading if heading is None else heading)
        velocity = setpoint.velocity or (0.0, 0.0, 0.0)
        if setpoint.frame == _BODY_NED:
            velocity = turned(velocity, pilot.body.heading)
        return DriveManoeuvre(velocity, heading=heading, turn_rate=setpoint.turn_rate)

    def _place(self, frame: int, position: Triple) -> Triple:
        """Return a target as a local position."""
        if frame == _LOCAL_NED:
            return position
        pilot = self._pilot
        x, y, z = position
        base = pilot.home.place[2] if frame in _RELATIVE_FRAMES and pilot.home.place is not None else 0.0
        return pilot.frame.ned_of(x, y, z + base)


def _refusal(setpoint: ReceivedSetpoint, *, local: bool) -> str:
    """Return why a setpoint is not taken, empty when it is."""
    frames = {_LOCAL_NED, _BODY_NED} if local else _RELATIVE_FRAMES | _AMSL_FRAMES
    if setpoint.frame not in frames:
        return f"SET_POSITION_TARGET: coordinate frame {setpoint.frame} unsupported"
    wanted = setpoint.velocity if setpoint.frame == _BODY_NED else setpoint.velocity or setpoint.position
    if wanted is None or not setpoint.finite or setpoint.force:
        return "SET_POSITION_TARGET: invalid"
    return ""
