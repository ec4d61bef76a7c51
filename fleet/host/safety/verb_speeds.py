"""Speeds of motion verbs without a magnitude, and the operator's setting of them.

``set_linear_velocity`` and ``set_angular_velocity`` move nothing: they store the speed of later verbs of the
same session, within the robot's limits. The setting is dropped at a stop, when another sender takes the
robot, and when the adapter restarts, so that a robot is never unexpectedly fast.
"""

from __future__ import annotations

import msgspec

from fleet.model.command import Command
from fleet.robot_config import AdapterConfig, Limits
from fleet.wire.commands import SETTINGS, MotionDefaults

VERB_SPEED = 0.5  # m/s, and rad/s: a verb without a magnitude, where no session set one


class _SpeedSetting(msgspec.Struct, frozen=True):
    """Setting of one session: ``linear`` in m/s and ``angular`` in rad/s, None where not set."""

    session: str
    linear: float | None = None
    angular: float | None = None


class VerbSpeeds:
    """Verb speeds of one robot. ``of`` may be called from any thread, the rest from the event loop."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._plain = self._defaults(None, None)
        self._setting: _SpeedSetting | None = None

    def configure(self, _config: AdapterConfig, limits: Limits) -> None:
        """Apply other limits; the operator's setting is dropped."""
        self._limits = limits
        self._plain = self._defaults(None, None)
        self.forget()

    def of(self, session: str) -> MotionDefaults:
        """Return the magnitudes for a session's verbs without one."""
        setting = self._setting
        if setting is None or setting.session != session:
            return self._plain
        return self._defaults(setting.linear, setting.angular)

    def store(self, request: Command) -> dict[str, float]:
        """Store the setting in a command; return the applied value under its name, within the limits."""
        field = SETTINGS[request.name]
        limit = self._limits.speed if field == "linear" else self._limits.yaw_rate
        applied = _within(abs(request.data[field]), limit)
        self.driven_by(request.origin.session)
        before = self._setting or _SpeedSetting(request.origin.session)
        self._setting = msgspec.structs.replace(before, **{field: applied})
        return {field: applied}

    def driven_by(self, session: str) -> None:
        """Record the session that moves the robot; a setting of another session is dropped."""
        if self._setting is not None and self._setting.session != session:
            self.forget()

    def forget(self) -> None:
        """Return to the default magnitudes."""
        self._setting = None

    def _defaults(self, linear: float | None, angular: float | None) -> MotionDefaults:
        """Return the magnitudes of verbs, each within its limit."""
        speed = VERB_SPEED if linear is None else linear
        turn = VERB_SPEED if angular is None else angular
        level = _within(speed, self._limits.speed)
        return MotionDefaults(
            forward=level,
            lateral=level,
            vertical=_within(speed, self._limits.vertical_speed),
            yaw_rate=_within(turn, self._limits.yaw_rate),
        )


def _within(magnitude: float, limit: float | None) -> float:
    """Return the magnitude, or the limit where that is smaller."""
    return magnitude if limit is None else min(magnitude, limit)
