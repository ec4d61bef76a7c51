"""Observed facts of the robots of a run, and the requirements and conditions evaluated on them."""

from __future__ import annotations

import math
from collections.abc import Iterable

from fleet.missions.program import Condition, Require
from fleet.missions.state import Facts

HEALTHS = ("ok", "degraded", "offline", "fault")
MOVED = 3.0  # m from the paused position beyond which a person is asked


class RobotFacts:
    """The newest facts of each robot, and the times of its events (s of the run's clock)."""

    def __init__(self) -> None:
        self._facts: dict[str, Facts] = {}
        self._events: dict[tuple[str, str], float] = {}

    def replace(self, facts: Facts) -> Facts | None:
        """Store facts; return the previous ones."""
        before = self._facts.get(facts.robot)
        self._facts[facts.robot] = facts
        return before

    def record_event(self, robot: str, event: str, now: float) -> None:
        """Store the time of an event."""
        self._events[robot, event] = now

    def position(self, robot: str) -> tuple[float, float, float] | None:
        """Return the position of a robot, None if unknown."""
        facts = self._facts.get(robot)
        return facts.position if facts else None

    def words(self, robot: str) -> str:
        """Describe the observed state of a robot."""
        facts = self._facts.get(robot)
        if facts is None:
            return "nothing is seen of it"
        words = [facts.health, facts.progress or "idle"]
        if facts.position is not None:
            words.append("at " + " ".join(f"{each:.1f}" for each in facts.position))
        return ", ".join(words)

    def lacks(self, robot: str, require: Require) -> str:
        """Return the first requirement that a robot does not meet, else an empty text.

        Unknown values do not meet a requirement.
        """
        facts = self._facts.get(robot)
        if facts is None:
            return "nothing is known of it yet"
        if facts.health not in HEALTHS or HEALTHS.index(facts.health) > HEALTHS.index(require.health):
            return f"its health is {facts.health}, {require.health} is required"
        return _battery_trouble(facts.battery, require.battery_min, require.battery_max)

    def moved(self, robot: str, since: tuple[float, float, float] | None) -> str:
        """Describe how far a robot is from its paused position; empty if close or if that was unknown."""
        now = self.position(robot)
        if since is None or now is None:
            return "" if since is None else "its position is unknown"
        metres = math.dist(since, now)
        return f"it is {metres:.1f} m from where it was left" if metres > MOVED else ""

    def holds(self, condition: Condition, robots: Iterable[str], since: float) -> bool:
        """Return True if a condition holds of robots; events count from ``since``. Without robots: False."""
        found = [self._is_so(condition, robot, since) for robot in robots]
        return bool(found) and (all(found) if condition.every else any(found))

    def _is_so(self, condition: Condition, robot: str, since: float) -> bool:
        """Return True if a condition holds of one robot."""
        if condition.event:
            return self._events.get((robot, condition.event), -math.inf) >= since
        facts = self._facts.get(robot)
        if facts is None:
            return False
        if condition.health:
            return facts.health == condition.health
        return not _battery_trouble(facts.battery, condition.battery_min, condition.battery_max)


def _battery_trouble(percent: float | None, least: float | None, most: float | None) -> str:
    """Return why a battery is out of bounds; empty if it is within, or without bounds."""
    if least is None and most is None:
        return ""
    if percent is None:
        return "its battery is unknown"
    if least is not None and percent < least:
        return f"its battery is at {percent:.3g} %, {least:g} % is required"
    if most is not None and percent > most:
        return f"its battery is at {percent:.3g} %, at most {most:g} % is required"
    return ""
