"""Source types that a robot obeys (contract 2.2).

A real robot obeys ``tele``, and for navigation also ``edge``, with which the SDK stamps its goals; a
simulated robot obeys ``sim_tele`` and ``sim``. Stops pass from any sender. A local program without a source
type is obeyed: a process that can open the bus's socket can already do anything to the robot.
"""

from __future__ import annotations

from fleet.model.command import Origin, Transport
from fleet.robot_config import Accepts

REAL_COMMAND = frozenset({"tele"})
REAL_NAVIGATE = frozenset({"tele", "edge"})
SIMULATED = frozenset({"sim_tele", "sim"})
NOBODY: frozenset[str] = frozenset()


class SourcePolicy:
    """Accepted source types of one robot, for commands, navigation and missions."""

    def __init__(self, accepts: Accepts, *, simulated: bool) -> None:
        command, navigate = (SIMULATED, SIMULATED) if simulated else (REAL_COMMAND, REAL_NAVIGATE)
        # An empty list is not the default: it admits no sender.
        self.command: frozenset[str] = command if accepts.command is None else accepts.command
        self.navigate: frozenset[str] = navigate if accepts.navigate is None else accepts.navigate
        self.mission: frozenset[str] = accepts.mission or NOBODY

    def refusal(self, origin: Origin, *, navigation: bool = False) -> str | None:
        """Return why this sender is not obeyed; None when it is."""
        accepted = self.navigate if navigation else self.command
        return None if origin.source_type in accepted else _refusal(origin, accepted)

    def mission_refusal(self, origin: Origin, *, commands: bool, navigates: bool) -> str | None:
        """Return why this sender may not start a mission that commands or navigates the robot, else None.

        It needs the right to start missions and the right to each kind of request in the mission: a mission
        gives its sender no further rights.
        """
        accepted = origin.source_type in self.mission
        return (
            (None if accepted else _refusal(origin, self.mission))
            or (self.refusal(origin) if commands else None)
            or (self.refusal(origin, navigation=True) if navigates else None)
        )


def _refusal(origin: Origin, accepted: frozenset[str]) -> str | None:
    """Return why a sender whose source type is not ``accepted`` is not obeyed; None when it is."""
    if origin.transport is Transport.MISSION or (
        origin.transport is Transport.BUS and origin.source_type is None
    ):
        return None
    given = "no source_type" if origin.source_type is None else f"source_type {origin.source_type!r}"
    return f"{given}; this robot accepts {', '.join(sorted(accepted)) or 'no source_type'}"
