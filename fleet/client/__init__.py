"""Python client of the edges that run: start missions and follow them, command robots, stop them.

``Fleet`` is one way to the edges, ``MissionRun`` one run of a mission. All else is what they return.
"""

from __future__ import annotations

from fleet.client.fleet import Fleet
from fleet.client.missions import MissionRun

__all__ = ["Fleet", "MissionRun"]
