"""What is noted of a rehearsal as it goes: what robots did, what happened, and how near they came."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Callable, Iterable, Mapping

from fleet.host.safety.separation import Occupant
from fleet.missions.rehearsal import Approach, RehearsalNote, RehearsedPart
from fleet.missions.state import Part
from fleet.missions.store import Change, Store

WRITES = 0.005  # s that a disk takes for a change
MOVES = 0.05  # m/s from which on a robot moves
ROUNDED = 0.05  # m that two robots which stand may seem nearer
SHOWN = 10  # pairs of robots, the nearest first


class NotedChanges(Store):
    """A store of runs that keeps what was done and what happened in memory.

    ``told`` hears each note. In simulated time nothing may be waited for that happens on another thread, so
    a write takes a time of its own on the event loop.
    """

    def __init__(self, told: Callable[[RehearsalNote], None]) -> None:
        self.problem = self.lost = ""
        self.parts: dict[str, Part] = {}
        self.notes: list[RehearsalNote] = []
        self._told = told

    def save(self, change: Change, done: Callable[[bool], None]) -> None:
        """Note a change."""
        for each in change.touched:
            if isinstance(each, Part):
                self.parts[each.identity] = each
        for note in change.notes:
            found = RehearsalNote(round(change.elapsed, 1), note.text, note.step, note.robot)
            self.notes.append(found)
            self._told(found)
        asyncio.get_running_loop().call_later(WRITES, done, True)

    def timeline(self) -> tuple[RehearsedPart, ...]:
        """Return what robots did, in the order in which it began."""
        return tuple(
            RehearsedPart(
                part.step,
                part.robot,
                part.role,
                part.act.words,
                round(part.began, 1),
                None if part.inflight else round(part.ended, 1),
                part.outcome.value if part.outcome else "",
                part.reason,
            )
            for part in sorted(self.parts.values(), key=lambda part: part.began)
        )


class Distances:
    """How near robots came to each other, of which one at least takes part and one moves."""

    def __init__(self, taking_part: Iterable[str]) -> None:
        self._taking_part = frozenset(taking_part)
        self._nearest: dict[tuple[str, str], Approach] = {}
        self._first: dict[tuple[str, str], float] = {}  # m from each other at the first look

    def look(self, robots: Mapping[str, Occupant], at: float) -> None:
        """Take where the robots are at ``at`` (simulated s of the run)."""
        for one, other in itertools.combinations(sorted(robots), 2):
            first, second = robots[one], robots[other]
            metres = (first.at - second.at).norm()
            self._first.setdefault((one, other), metres)
            moves = max(first.velocity.norm(), second.velocity.norm()) > MOVES
            if not moves or not self._taking_part & {one, other}:
                continue
            known = self._nearest.get((one, other))
            if known is None or metres < known.metres:
                kept = first.radius + second.radius
                self._nearest[one, other] = Approach((one, other), metres, at, kept)

    def too_near(self) -> tuple[Approach, ...]:
        """Return the pairs that came nearer than both radii, but for those that began as near as that."""
        return tuple(
            each
            for each in self.nearest()
            if each.metres < min(each.kept, self._first[each.robots] - ROUNDED)
        )

    def nearest(self) -> tuple[Approach, ...]:
        """Return the nearest approach of each pair, the nearest first."""
        found = sorted(self._nearest.values(), key=lambda each: each.metres)
        return tuple(
            Approach(each.robots, round(each.metres, 2), round(each.at, 1), round(each.kept, 2))
            for each in found[:SHOWN]
        )
