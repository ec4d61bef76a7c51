"""Task of a rehearsal's process: the mission, and the robots as they are now.

It contains nothing of the cloud, the bus or the edge's folders.
"""

from __future__ import annotations

import msgspec

from fleet.host.workers.worker_task import RobotTask
from fleet.missions.program import Program
from fleet.missions.rehearsal import RehearsalNote, RehearsalResult
from fleet.model.geodesy import GeoOrigin
from fleet.model.place import Place
from fleet.model.state import RobotState


class PlacedRobot(msgspec.Struct, frozen=True):
    """A robot of the edge: its adapter and config, and its state when the rehearsal was requested."""

    task: RobotTask
    state: RobotState


class RehearsalTask(msgspec.Struct, frozen=True):
    """One rehearsal. ``mission`` is the checked model (JSON) from which ``program`` was made.

    ``places`` and ``groups`` are those of fleet.yaml. ``folder``: base of relative paths. ``transport``,
    ``source_type`` and ``session_id`` are the authority under which the mission would run.
    """

    name: str
    mission: str
    program: Program
    roles: dict[str, list[str]]
    robots: tuple[PlacedRobot, ...]
    places: dict[str, Place]
    groups: dict[str, list[str]]
    folder: str
    site: GeoOrigin | None = None
    transport: str = msgspec.field(name="way", default="bus")
    source_type: str | None = None
    session_id: str = ""
    seed: int = 1


class RehearsalLine(msgspec.Struct, frozen=True, omit_defaults=True):
    """One line of the process's output: progress, an event, the result, or a failure."""

    seconds: float = 0.0
    step: str = ""
    note: RehearsalNote | None = None
    result: RehearsalResult | None = None
    failure: str = ""
