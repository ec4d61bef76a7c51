"""What a run knows of its robots from what was seen, and what follows from it: requirements, conditions."""

from __future__ import annotations

import math
from collections.abc import Iterable

from fleet.missions.program import Condition, Require
from fleet.missions.state import Facts

HEALTHS = ("ok", "degraded", "offline", "fault")
MOVED = 3.0  # m from where a robot was left, beyond which a person is asked


class Seen:
    """The newest facts of each robot, and the events reported of it, by when (s of the run's clock)."""

    def __init__(self) -> None:
        self._facts: dict[str, Facts] = {}
        self._events: dict[tuple[str, str], float] = {}

    def take(self, facts: Facts) -> Facts | None:
        """Take facts; return those that were known before."""
        before = self._facts.get(facts.robot)
        self._facts[facts.robot] = facts
        return before

    def heard(self, robot: str, event: str, now: float) -> None:
        """Take an event."""
        self._events[robot, event] = now

    def position(self, robot: str) -> tuple[float, float, float] | None:
        """Return where a robot is, None while that is unknown."""
        facts = self._facts.get(robot)
        return facts.position if facts else None

    def words(self, robot: str) -> str:
        """Return what is seen of a robot now, for people."""
        facts = self._facts.get(robot)
        if facts is None:
            return "nothing is seen of it"
        words = [facts.health, facts.progress or "idle"]
        if facts.position is not None:
            words.append("at " + " ".join(f"{each:.1f}" for each in facts.position))
        return ", ".join(words)

    def lacks(self, robot: str, require: Require) -> str:
        """Return what a robot lacks of what is required; empty for nothing. Unknown counts as lacking."""
        facts = self._facts.get(robot)
        if facts is None:
            return "nothing is known of it yet"
        if facts.health not in HEALTHS or HEALTHS.index(facts.health) > HEALTHS.index(require.health):
            return f"its health is {facts.health}, {require.health} is required"
        return _battery_trouble(facts.battery, require.battery_min, require.battery_max)

    def moved(self, robot: str, since: tuple[float, float, float] | None) -> str:
        """Return that a robot is not where it was left; empty when it is, or when nobody knew where."""
        now = self.position(robot)
        if since is None or now is None:
            return "" if since is None else "nobody knows where it is"
        metres = math.dist(since, now)
        return f"it is {metres:.1f} m from where it was left" if metres > MOVED else ""

    def holds(self, condition: Condition, robots: Iterable[str], since: float) -> bool:
        """Return whether a condition holds of robots; events count from ``since`` on. Of none: False."""
        found = [self._is_so(condition, robot, since) for robot in robots]
        return bool(found) and (all(found) if condition.every else any(found))

    def _is_so(self, condition: Condition, robot: str, since: float) -> bool:
        """Return whether a condition holds of one robot."""
        if condition.event:
            return self._events.get((robot, condition.event), -math.inf) >= since
        facts = self._facts.get(robot)
        if facts is None:
            return False
        if condition.health:
            return facts.health == condition.health
        return not _battery_trouble(facts.battery, condition.battery_min, condition.battery_max)


def _battery_trouble(percent: float | None, least: float | None, most: float | None) -> str:
    """Return why a battery is not within bounds; empty when it is, or there are none."""
    if least is None and most is None:
        return ""
    if percent is None:
        return "its battery is unknown"
    if least is not None and percent < least:
        return f"its battery is at {percent:.0f} %, {least:g} % is required"
    if most is not None and percent > most:
        return f"its battery is at {percent:.0f} %, at most {most:g} % is required"
    return ""
