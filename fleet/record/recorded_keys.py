"""The keys of the bus whose samples are recorded, or shown live; pure."""

from __future__ import annotations

from fleet.bus import keys

REPORTS = "cw/*/data/**"


def published(edge: str) -> tuple[str, ...]:
    """Return the recorded keys of an edge besides reports."""
    return (*requested_first(edge), keys.positions(edge, "*"), keys.held(edge), keys.stop(edge))


def requested_first(edge: str) -> tuple[str, ...]:
    """Return the keys whose last value is queried, because it may not be published soon."""
    return (keys.state(edge, "*"), keys.health(edge), keys.run(edge, "*"))
