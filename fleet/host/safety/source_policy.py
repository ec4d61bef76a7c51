"""Which source types a robot obeys (contract 2.2).

A real robot obeys ``tele``, and for navigation also ``edge`` (the SDK stamps its goals so); a simulated
one ``sim_tele`` and ``sim``. Stops are obeyed from anyone. A local program that says nothing is obeyed:
who can open the bus's socket can already do anything to the robot.
"""

from __future__ import annotations

from fleet.model.command import Origin, Transport
from fleet.robot_config import Accepts

REAL_COMMAND = frozenset({"tele"})
REAL_NAVIGATE = frozenset({"tele", "edge"})
SIMULATED = frozenset({"sim_tele", "sim"})


class SourcePolicy:
    """The two sets of one robot."""

    def __init__(self, accepts: Accepts, *, simulated: bool) -> None:
        self.command: frozenset[str] = accepts.command or (SIMULATED if simulated else REAL_COMMAND)
        self.navigate: frozenset[str] = accepts.navigate or (SIMULATED if simulated else REAL_NAVIGATE)

    def refusal(self, origin: Origin, *, navigation: bool = False) -> str | None:
        """Return why this asker is not obeyed, None when he is."""
        accepted = self.navigate if navigation else self.command
        if origin.source_type in accepted:
            return None
        if origin.way is Transport.MISSION or (origin.way is Transport.BUS and origin.source_type is None):
            return None
        given = "no source_type" if origin.source_type is None else f"source_type {origin.source_type!r}"
        return f"{given}; this robot obeys {', '.join(sorted(accepted))}"
