"""Many healths to one: an edge's own, from its robots and what it rests on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from fleet.model.health import Health, Level, worst
from fleet.model.state import RobotState

LEVELS = {level.word: level for level in Level}


def robots_by_health(states: Iterable[RobotState]) -> dict[str, int]:
    """Return how many robots there are of each health word, the best first."""
    counts = Counter(state.health for state in states)
    return {level.word: counts[level.word] for level in Level if counts[level.word]}


def edge_health(states: Iterable[RobotState], rests_on: Iterable[Health]) -> Health:
    """Return an edge's health: the worst cause there is, but a robot's alone only degrades the edge."""
    causes = [(health, health.level) for health in rests_on]
    for state in states:
        level = LEVELS[state.health]
        if level is not Level.OK:
            cause = f"{state.name} {state.health}: {state.cause}"
            causes.append((Health(min(level, Level.DEGRADED), cause), level))
    # Of what degrades the edge alike, what is worst in itself is told.
    causes.sort(key=lambda cause: cause[1], reverse=True)
    return worst(health for health, _ in causes)
