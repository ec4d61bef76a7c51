"""Aircraft with wings: they circle where a multirotor stands, and have a lowest airspeed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

from fleet import NotReady, Refused, Velocity
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vocabulary import ON_WINGS, WINGS

_WIDE = 120.0  # m, radius of a circle while its parameter is unknown
_LOOSE, _SHARE = 15.0, 0.15  # m, and share of its radius: tolerance of a circle
HEIGHT = 8.0  # m; PX4 circles 2 to 7 m below its height for a minute, more at higher speeds


class Winged(Flavour):
    """Forward flight of any aircraft with wings."""

    wings: ClassVar[bool] = True
    tolerance: ClassVar[float] = HEIGHT
    speed_kind: ClassVar[float] = 0.0  # airspeed
    lowest: ClassVar[float] = 15.0
    passes: ClassVar[float] = 150.0
    circle: ClassVar[str]  # parameter with the radius of its circles, m; its sign is the direction
    airspeeds: ClassVar[tuple[str, str, str]]  # parameters: lowest, cruise, highest
    lands_here: ClassVar[bool]  # RTL ends on the ground; False: it circles over its home
    lacking: ClassVar[Mapping[str, str]] = WINGS

    @property
    def settings(self) -> tuple[str, ...]:
        """Parameters that it needs for moving."""
        return (self.circle, *self.airspeeds)

    @property
    def hovers_at_home(self) -> bool:
        """Whether its return home ends without a landing."""
        return not self.lands_here

    def stands(self, state: VehicleState) -> bool:  # noqa: ARG002 - never
        """Return False: it circles."""
        return False

    def cannot(self, velocity: Velocity, *, turns_in_place: bool | None) -> str:  # noqa: ARG002 - for any
        """Return the reason against every velocity."""
        return ON_WINGS

    def speed_to(
        self,
        state: VehicleState,
        limit: float | None,
        wanted: float | None,
        metres: float,  # noqa: ARG002 - always on its wings
    ) -> float:
        """Return the airspeed."""
        return self.airspeed(state, limit, wanted)

    def radius(self, state: VehicleState) -> float:
        """Return the radius of its circles, m."""
        return abs(state.settings.get(self.circle, _WIDE)) or _WIDE

    def reach(self, state: VehicleState) -> float:
        """Return the largest distance from the centre of its circle, m."""
        radius = self.radius(state)
        return radius + max(_LOOSE, _SHARE * radius)

    def airspeed(self, state: VehicleState, limit: float | None, wanted: float | None) -> float:
        """Return the airspeed to fly at, m/s: the wanted one, else its cruise, within the limit.

        Raises NotReady while its own airspeeds are unknown, Refused below the lowest.
        """
        speeds = [state.settings.get(name) for name in self.airspeeds]
        if None in speeds:
            raise NotReady(
                "its airspeeds are not known yet", hint="they are read after the vehicle connects; try again"
            )
        slowest, cruise, fastest = (each for each in speeds if each is not None)
        speed = min(cruise if wanted is None else wanted, math.inf if limit is None else limit, fastest)
        if speed < slowest:
            named = f"{slowest:g} m/s ({self.airspeeds[0]})"
            whose = "it was asked for" if wanted == speed else "its limit is"
            raise Refused(
                f"{whose} {speed:g} m/s, and it cannot fly slower than {named}",
                hint=f"give limits.speed in fleet.yaml at least {slowest:g}",
            )
        return speed
