"""Names in a fleet file that missions may use: robots, groups, places and events."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fleet.config.missions import KnownNames, events_of


def known_of(data: Mapping[str, Any]) -> KnownNames:
    """Return the known names from the data of a fleet file, whatever other errors it has."""
    listed = data.get("robots")
    robots = [
        robot.get("name") for robot in (listed if isinstance(listed, list) else ()) if isinstance(robot, dict)
    ]
    partners = data.get("partners")
    for partner in partners.values() if isinstance(partners, dict) else ():
        there = partner.get("robots") if isinstance(partner, dict) else None
        robots += there if isinstance(there, list) else []
    groups = data.get("groups")
    places = data.get("places")
    names = [str(name) for name in (*robots, *(groups if isinstance(groups, dict) else ()))]
    site = data.get("site")
    on_earth = isinstance(site, dict) and site.get("origin") is not None
    events = data.get("events")
    return KnownNames(
        names,
        list(places) if isinstance(places, dict) else [],
        on_earth=on_earth,
        events=events_of(events if isinstance(events, list) else ()),
    )
