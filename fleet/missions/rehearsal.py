"""Messages of rehearsals, and validity of a pass; pure.

A mission with ``rehearse: required`` starts only with a valid pass. The edge stores a pass after a rehearsal
of the same program (including its inputs), with the same robots in the same roles and the same configuration.
It is valid for an hour, while every robot is within three metres of its position at the rehearsal.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import msgspec

from fleet.missions.program import Program

FRESH = 3600.0  # s for which a pass is valid
NEAR = 3.0  # m by which a robot may have moved
TrackPoint = tuple[float, float, float]


class RehearsedPart(msgspec.Struct, frozen=True, omit_defaults=True):
    """Part of one robot in a step; ``began`` and ``ended`` are simulated seconds of the run.

    ``ended`` is None for a part that was still in progress at the end.
    """

    step: str
    robot: str
    role: str
    does: str
    began: float
    ended: float | None = None
    outcome: str = ""
    reason: str = ""


class RehearsalNote(msgspec.Struct, frozen=True, omit_defaults=True):
    """A line in the log of the rehearsed run; ``at``: simulated seconds of the run."""

    at: float
    text: str
    step: str = ""
    robot: str = ""


class ClosestApproach(msgspec.Struct, frozen=True, omit_defaults=True):
    """The closest approach of two robots in metres, and its time (simulated seconds of the run).

    ``kept``: the sum of both radii (``separation`` in fleet.yaml).
    """

    robots: tuple[str, str]
    metres: float
    at: float
    kept: float


class RehearsedRobot(msgspec.Struct, frozen=True, omit_defaults=True):
    """A robot of the rehearsal. ``played_by`` names its simulator; ``stand_in``: a kinematic stand-in.

    ``role`` is empty for a robot that only stands at its position. Batteries are percent; None: not reported.
    """

    robot: str
    played_by: str
    stand_in: bool = False
    role: str = ""
    outcome: str = ""
    reason: str = ""
    battery_before: float | None = None
    battery_left: float | None = None


class RehearsedTrack(msgspec.Struct, frozen=True):
    """Track of a robot: points of simulated seconds of the run, x, y and z in metres in the site's frame.

    Between two points it moved straight. The end of a standstill is a point too.
    """

    robot: str
    points: tuple[tuple[float, float, float, float], ...]


class RehearsalResult(msgspec.Struct, frozen=True, omit_defaults=True):
    """Result of a rehearsal. ``seconds`` are simulated, ``took`` is the computing time.

    ``outcome`` is that of the run. ``troubles``: why it is no pass, empty for a pass. ``assumed``:
    assumptions that a rehearsal cannot verify. ``pass_until`` is the Unix time until which the edge accepts
    it as a pass, 0 if not. ``tracks``: those of robots in roles that are placed in the site's frame.
    """

    mission: str
    outcome: str
    seconds: float
    reason: str = ""
    troubles: tuple[str, ...] = ()
    robots: tuple[RehearsedRobot, ...] = ()
    timeline: tuple[RehearsedPart, ...] = ()
    notes: tuple[RehearsalNote, ...] = ()
    approaches: tuple[ClosestApproach, ...] = ()
    assumed: tuple[str, ...] = ()
    seed: int = 1
    took: float = 0.0
    pass_until: float = 0.0
    tracks: tuple[RehearsedTrack, ...] = ()

    @property
    def passed(self) -> bool:
        """True if the rehearsal found no reason against the mission."""
        return not self.troubles


class RehearsalState(msgspec.Struct, frozen=True, omit_defaults=True):
    """Present state of a rehearsal; the reply to its start and to a poll.

    ``refusal``: why it was not started. ``seconds`` are simulated, ``notes`` those since the last poll.
    """

    id: str = ""
    refusal: str = ""
    roles: dict[str, list[str]] = {}
    seconds: float = 0.0
    step: str = ""
    notes: tuple[RehearsalNote, ...] = ()
    result: RehearsalResult | None = None
    failure: str = ""


class RehearsalPoll(msgspec.Struct, frozen=True):
    """Poll of a rehearsal; ``since``: number of notes received so far."""

    id: str
    since: int = 0


class StoredPass(msgspec.Struct, frozen=True):
    """A pass as the edge stores it; ``stamp`` is Unix seconds.

    ``places`` are the positions of the robots of its roles at the rehearsal, metres, from their states.
    """

    mission: str
    program: str
    config: str
    roles: dict[str, list[str]]
    places: dict[str, TrackPoint]
    stamp: float


def digest(*parts: Any) -> str:
    """Return a digest of data."""
    return hashlib.blake2b(msgspec.json.encode(parts), digest_size=16).hexdigest()


def program_digest(program: Program) -> str:
    """Return the digest of a program: the mission with its inputs and files."""
    return digest(program)


class Present(msgspec.Struct, frozen=True):
    """The present situation that a pass is compared with; ``now`` is Unix s.

    ``roles`` is None if they cannot be filled yet; then roles and positions are not compared.
    """

    program: Program
    config: str
    now: float
    places: Mapping[str, TrackPoint | None]
    roles: Mapping[str, Sequence[str]] | None


def refusal(passes: Iterable[StoredPass], present: Present) -> str:
    """Return why no pass permits the start of a mission; empty if one does. Newest passes come first."""
    wanted = program_digest(present.program)
    reasons = [stale_reason(passed, present) for passed in passes if passed.program == wanted]
    if not all(reasons):
        return ""
    return reasons[0] if reasons else "it has not been rehearsed with these inputs"


def stale_reason(passed: StoredPass, present: Present) -> str:
    """Return why a pass of the same program is not valid now; empty if it is."""
    roles = present.roles
    if passed.config != present.config:
        return "fleet.yaml has changed since the rehearsal"
    if not 0.0 <= present.now - passed.stamp <= FRESH:
        return "the rehearsal is more than an hour old"
    if roles is not None and passed.roles != {role: list(names) for role, names in roles.items()}:
        was = "; ".join(f"{role}: {', '.join(names)}" for role, names in passed.roles.items())
        return f"it was rehearsed with others: {was}"
    return _moved(passed, present.places) if roles is not None else ""


def _moved(passed: StoredPass, places: Mapping[str, TrackPoint | None]) -> str:
    """Return which robot has moved since the rehearsal; empty if none has."""
    for robot, was in passed.places.items():
        now = places.get(robot)
        if now is None:
            return f"the position of {robot} is unknown"
        metres = math.dist(was, now)
        if metres > NEAR:
            return f"{robot} is {metres:.1f} m from where it was at the rehearsal"
    return ""
