"""Positions of other robots of the edge, for a robot that follows one of them."""

from __future__ import annotations

from fleet.errors import NotReady
from fleet.host.robot.separation_keeper import SeparationKeeper
from fleet.model.geometry import Vector3

LOST = 2.0  # s without a report after which a robot is no longer followed


class RelativePositions:
    """Positions of others in the frame of ``among``, one robot's keeper; None while it has none."""

    def __init__(self) -> None:
        self.among: SeparationKeeper | None = None

    def of(self, name: str) -> tuple[Vector3, float]:
        """Return a robot's last position, in the world of the robot that follows it, and its age in seconds.

        Raises NotReady where it is unknown, or was not reported for too long.
        """
        own = self.among
        if own is None or own.placement is None:
            who = "it" if own is None else own.name
            raise NotReady(f"{who} is not placed in the site's frame, and cannot follow {name}")
        found = None if name == own.name else own.others.seen(own.name, name)
        if found is None:
            raise NotReady(f"the position of {name} in the frame of {own.name} is unknown")
        if found.age > LOST:
            raise NotReady(f"{name} has not reported its position for {found.age:.1f} s")
        return own.placement.to_world(found.at), found.age

    def trouble(self, name: str) -> str:
        """Return why a robot cannot be followed; empty when it can."""
        try:
            self.of(name)
        except NotReady as error:
            return str(error)
        return ""
