"""The keys of the bus whose samples are recorded, or shown live; pure."""

from __future__ import annotations

from fleet.bus import keys

REPORTS = "cw/*/data/**"


def published(edge: str) -> tuple[str, ...]:
    """Return the keys on which an edge publishes what is recorded besides reports."""
    return (*asked_first(edge), keys.places(edge, "*"), keys.held(edge), keys.stop(edge))


def asked_first(edge: str) -> tuple[str, ...]:
    """Return the keys whose last value is asked for: what does not change is not published soon."""
    return (keys.state(edge, "*"), keys.health(edge), keys.run(edge, "*"))
