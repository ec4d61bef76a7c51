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
        command, navigate = (SIMULATED, SIMULATED) if simulated else (REAL_COMMAND, REAL_NAVIGATE)
        # An empty list is no default: it lets nobody in.
        self.command: frozenset[str] = command if accepts.command is None else accepts.command
        self.navigate: frozenset[str] = navigate if accepts.navigate is None else accepts.navigate
        self.mission: frozenset[str] = accepts.mission or frozenset()

    def refusal(self, origin: Origin, *, navigation: bool = False) -> str | None:
        """Return why this asker is not obeyed, None when he is."""
        return _refusal(origin, self.navigate if navigation else self.command)

    def mission_refusal(self, origin: Origin, *, commands: bool, navigates: bool) -> str | None:
        """Return why this asker may not start a mission that commands the robot, or leads it; None if so.

        He must be let in for missions, and for each thing that the mission asks: it gives nobody rights.
        """
        return (
            _refusal(origin, self.mission)
            or (self.refusal(origin) if commands else None)
            or (self.refusal(origin, navigation=True) if navigates else None)
        )


def _refusal(origin: Origin, accepted: frozenset[str]) -> str | None:
    """Return why an asker is not among those who are accepted; None when he is."""
    if origin.source_type in accepted:
        return None
    if origin.way is Transport.MISSION or (origin.way is Transport.BUS and origin.source_type is None):
        return None
    given = "no source_type" if origin.source_type is None else f"source_type {origin.source_type!r}"
    return f"{given}; this robot obeys {', '.join(sorted(accepted)) or 'nobody'}"
