"""Missions of fleet.yaml that can be started, as of its last change."""

from __future__ import annotations

from collections.abc import Mapping

from fleet.config.load import Loaded
from fleet.config.missions import Mission, events_of, mission_of
from fleet.errors import Refused
from fleet.missions.report import MissionStartRequest


class KnownMissions:
    """Missions of one edge by name. A changed fleet.yaml replaces them; runs keep their own copies."""

    def __init__(self, loaded: Loaded) -> None:
        self.configure(loaded)

    def configure(self, loaded: Loaded) -> None:
        """Use the missions and events of another configuration; any thread may read meanwhile."""
        self._events = events_of(loaded.config.events)
        self.by_name: Mapping[str, Mission] = {mission.name: mission for mission in loaded.missions}

    def get(self, name: str) -> Mission | None:
        """Return a mission by its name; None for an unknown one."""
        return self.by_name.get(name)

    def requested(self, name: str, request: MissionStartRequest) -> Mission:
        """Return the mission of a request, which may contain its own; raises Refused, InvalidConfig."""
        missions = self.by_name
        if request.mission is not None:
            return mission_of(name, request.mission, missions, self._events)
        mission = missions.get(name)
        if mission is None:
            known = ", ".join(missions) or "none"
            raise Refused(f"there is no mission {name!r}", hint=f"fleet.yaml has {known}")
        return mission
