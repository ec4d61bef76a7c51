"""From a message on any way in to an ask at a robot's desk."""

from __future__ import annotations

from collections.abc import Callable

from fleet.model.command import Command, Setpoint, Way
from fleet.model.navigation import Navigate
from fleet.robot_config import AdapterConfig
from fleet.wire.commands import Defaults, decode_command, decode_motion
from fleet.wire.joints import decode_joints
from fleet.wire.missions import decode_mission
from fleet.wire.navigation import decode_navigate
from fleet.wire.rules import Kind

Ask = Command | Setpoint | Navigate


class Decoder:
    """Decodes what is asked of one robot; raises WireError with the reason for what cannot be read.

    ``defaults`` gives the magnitudes of a session's verbs that bring none, ``home_altitude`` metres above sea
    level of the take-off point, from which geodetic goals count.
    """

    def __init__(
        self,
        config: AdapterConfig,
        defaults: Defaults,
        *,
        planar: bool,
        home_altitude: Callable[[], float | None] = lambda: None,
    ) -> None:
        self._twin = str(config.twin)
        self._order = config.rotation_order
        self._origin = config.origin
        self._home_altitude = home_altitude
        self._planar = planar
        self._defaults = defaults
        self._decoders: dict[Kind, Callable[..., Ask | None]] = {
            "navigate": self._navigate,
            "motion": decode_motion,
            "joints": decode_joints,
            "mission": self._mission,
        }

    def decode(self, kind: Kind, payload: bytes, *, way: Way, request_id: str = "") -> Ask | None:
        """Return the ask in a message; None for one that asks nothing (a reply)."""
        if kind == "command":
            return decode_command(
                payload, way=way, request_id=request_id, defaults=self._defaults, twin=self._twin
            )
        return self._decoders[kind](payload, way=way, request_id=request_id, twin=self._twin)

    def _navigate(self, payload: bytes, *, way: Way, request_id: str, twin: str) -> Ask | None:
        """Decode the ``navigate/command`` topic's messages."""
        origin = self._origin
        home = self._home_altitude()
        return decode_navigate(
            payload,
            way=way,
            request_id=request_id,
            rotation_order=self._order,
            planar=self._planar,
            home_altitude=origin.altitude if home is None and origin else home,
            origin_heading=origin.heading if origin else 0.0,
            twin=twin,
        )

    def _mission(self, payload: bytes, *, way: Way, request_id: str, twin: str) -> Ask | None:  # noqa: ARG002 - the others have it
        """Decode the ``mission/command`` topic's messages."""
        return decode_mission(payload, way=way, twin=twin)
