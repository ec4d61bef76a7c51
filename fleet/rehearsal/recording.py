"""Records of a rehearsal: acts, tracks, events, and distances between robots."""

from __future__ import annotations

import asyncio
import itertools
import math
from collections.abc import Callable, Iterable, Mapping

from fleet.host.safety.separation import Occupant
from fleet.missions.rehearsal import ClosestApproach, RehearsalNote, RehearsedPart, RehearsedTrack
from fleet.missions.state import StepPart
from fleet.missions.store import RunChange, RunStore

WRITES = 0.005  # s of a simulated disk write
MOVES = 0.05  # m/s above which a robot counts as moving
ROUNDED = 0.05  # m by which two standing robots may seem closer
SHOWN = 10  # pairs of robots, closest first
APART = 0.1  # m between two points of a track
STANDS = 0.02  # m between two samples below which a robot counts as standing
MOST_POINTS = 400  # of one track; beyond that it gets coarser
RecordedPoint = tuple[float, float, float, float]
"""Simulated seconds of the run, and metres."""


class MemoryStore(RunStore):
    """A store of runs that keeps parts and notes in memory.

    ``on_note`` receives each note. In simulated time nothing may wait for another thread, so a write takes a
    fixed time on the event loop.
    """

    def __init__(self, on_note: Callable[[RehearsalNote], None]) -> None:
        self.problem = self.lost = ""
        self.parts: dict[str, StepPart] = {}
        self.notes: list[RehearsalNote] = []
        self._on_note = on_note

    def save(self, change: RunChange, done: Callable[[bool], None]) -> None:
        """Store a change."""
        for each in change.touched:
            if isinstance(each, StepPart):
                self.parts[each.identity] = each
        for note in change.notes:
            found = RehearsalNote(round(change.elapsed, 1), note.text, note.step, note.robot)
            self.notes.append(found)
            self._on_note(found)
        asyncio.get_running_loop().call_later(WRITES, done, True)

    def timeline(self) -> tuple[RehearsedPart, ...]:
        """Return the parts of the robots, in the order of their start."""
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
    """Closest approaches of pairs of robots of which at least one takes part and one moves."""

    def __init__(self, taking_part: Iterable[str]) -> None:
        self._taking_part = frozenset(taking_part)
        self._nearest: dict[tuple[str, str], ClosestApproach] = {}
        self._first: dict[tuple[str, str], float] = {}  # m between them at the first sample

    def sample(self, robots: Mapping[str, Occupant], at: float) -> None:
        """Add the positions of the robots at ``at`` (simulated s of the run)."""
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
                self._nearest[one, other] = ClosestApproach((one, other), metres, at, kept)

    def too_near(self) -> tuple[ClosestApproach, ...]:
        """Return the pairs that came closer than the sum of their radii, unless they started that close."""
        return tuple(
            each
            for each in self.nearest()
            if each.metres < min(each.kept, self._first[each.robots] - ROUNDED)
        )

    def nearest(self) -> tuple[ClosestApproach, ...]:
        """Return the closest approach of each pair, closest first."""
        found = sorted(self._nearest.values(), key=lambda each: each.metres)
        return tuple(
            ClosestApproach(each.robots, round(each.metres, 2), round(each.at, 1), round(each.kept, 2))
            for each in found[:SHOWN]
        )


class Tracks:
    """Tracks of the participating robots, with a resolution for drawings."""

    def __init__(self, taking_part: Iterable[str]) -> None:
        self._tracks = {name: _RobotTrack() for name in sorted(taking_part)}

    def sample(self, robots: Mapping[str, Occupant], at: float) -> None:
        """Add the positions of the robots at ``at`` (simulated s of the run)."""
        for name, track in self._tracks.items():
            if name in robots:
                here = robots[name].at
                track.add((round(at, 1), round(here.x, 2), round(here.y, 2), round(here.z, 2)))

    def all(self) -> tuple[RehearsedTrack, ...]:
        """Return the tracks of robots with positions."""
        found = ((name, track.points()) for name, track in self._tracks.items())
        return tuple(RehearsedTrack(name, points) for name, points in found if points)


class _RobotTrack:
    """The points of one robot; ``_apart`` doubles when there are too many."""

    def __init__(self) -> None:
        self._kept: list[RecordedPoint] = []
        self._last: RecordedPoint | None = None
        self._moves = False
        self._apart = APART

    def add(self, point: RecordedPoint) -> None:
        """Add the next point; the kept points show the path, and where it started and stopped moving."""
        last, self._last = self._last, point
        if last is None:
            self._kept.append(point)
            return
        moved, self._moves = self._moves, math.dist(last[1:], point[1:]) > STANDS
        if moved != self._moves and last != self._kept[-1]:
            self._kept.append(last)
        if math.dist(self._kept[-1][1:], point[1:]) >= self._apart:
            self._kept.append(point)
        if len(self._kept) > MOST_POINTS:
            self._kept = self._kept[::2]
            self._apart *= 2

    def points(self) -> tuple[RecordedPoint, ...]:
        """Return the points, including the last one."""
        more = [self._last] if self._last is not None and self._last != self._kept[-1] else []
        return (*self._kept, *more)
