"""Where other robots of the edge are, for one that is led after them."""

from __future__ import annotations

from fleet.errors import NotReady
from fleet.host.robot.separation_keeper import SeparationKeeper
from fleet.model.geometry import Vector3

LOST = 2.0  # s after which a robot that was not heard of is followed no more


class Whereabouts:
    """The other robots as one of them sees them; ``among``: that one, None while it is alone."""

    def __init__(self) -> None:
        self.among: SeparationKeeper | None = None

    def of(self, name: str) -> tuple[Vector3, float]:
        """Return where a robot was last, in the world of the one that sees it, and how many seconds ago.

        Raises NotReady where nobody knows, or has not known for too long.
        """
        own = self.among
        if own is None or own.placement is None:
            who = "it" if own is None else own.name
            raise NotReady(f"{who} is not placed in the site's frame, and cannot follow {name}")
        found = None if name == own.name else own.others.seen(own.name, name)
        if found is None:
            raise NotReady(f"nobody knows where {name} is in the frame of {own.name}")
        if found.age > LOST:
            raise NotReady(f"{name} has not told where it is for {found.age:.1f} s")
        return own.placement.to_world(found.at), found.age

    def trouble(self, name: str) -> str:
        """Return why nobody can be led after a robot; empty when one can."""
        try:
            self.of(name)
        except NotReady as error:
            return str(error)
        return ""
