"""Python client of running edges: start and follow missions, command robots, stop them.

``Fleet`` is a connection to the edges, ``MissionRun`` one run of a mission. The other names are results.
"""

from __future__ import annotations

from fleet.client.fleet import Fleet
from fleet.client.missions import MissionRun

__all__ = ["Fleet", "MissionRun"]
