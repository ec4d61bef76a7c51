"""Health of an edge, aggregated from its robots and its own services."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from fleet.model.health import Health, Level, worst
from fleet.model.state import RobotState

LEVELS = {level.word: level for level in Level}


def robots_by_health(states: Iterable[RobotState]) -> dict[str, int]:
    """Return the number of robots at each health level, the best level first."""
    counts = Counter(state.health for state in states)
    return {level.word: counts[level.word] for level in Level if counts[level.word]}


def edge_health(states: Iterable[RobotState], rests_on: Iterable[Health]) -> Health:
    """Return an edge's health: the worst of all causes, where a robot can at most degrade the edge.

    ``rests_on`` are the healths of the edge's own services (bus, cloud, journal).
    """
    causes = [(health, health.level) for health in rests_on]
    for state in states:
        level = LEVELS[state.health]
        if level is not Level.OK:
            cause = f"{state.name} {state.health}: {state.cause}"
            causes.append((Health(min(level, Level.DEGRADED), cause), level))
    # For robots that degrade the edge equally, name the one with the worst health of its own.
    causes.sort(key=lambda cause: cause[1], reverse=True)
    return worst(health for health, _ in causes)
