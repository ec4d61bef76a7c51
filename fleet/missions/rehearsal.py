"""What a rehearsal is told and tells, and when a pass of one counts; pure.

A mission with ``rehearse: required`` is started only with a pass that is fresh: the edge wrote it after a
rehearsal of its own of the same program (inputs included), by the same robots in the same roles, with the
same configuration, at most an hour ago, and every robot is within three metres of where it was then.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import msgspec

from fleet.missions.program import Program

FRESH = 3600.0  # s for which a pass counts
NEAR = 3.0  # m that a robot may be from where it was
Point = tuple[float, float, float]


class RehearsedPart(msgspec.Struct, frozen=True, omit_defaults=True):
    """What one robot did for a step; ``began`` and ``ended`` are simulated seconds of the run.

    ``ended`` is None for what was still under way at the end.
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
    """A line of the rehearsed run's story; ``at``: simulated seconds of the run."""

    at: float
    text: str
    step: str = ""
    robot: str = ""


class Approach(msgspec.Struct, frozen=True, omit_defaults=True):
    """How near two robots came to each other, metres, and when (simulated seconds of the run).

    ``kept``: the radii of both together (``separation`` in fleet.yaml).
    """

    robots: tuple[str, str]
    metres: float
    at: float
    kept: float


class RehearsedRobot(msgspec.Struct, frozen=True, omit_defaults=True):
    """A robot of the rehearsal. ``played_by`` names its simulator; ``stand_in``: it had none in its place.

    ``role`` is empty for a robot that only stood where it is. Batteries are percent; None: not told.
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
    """Where a robot went: points of simulated seconds of the run, x, y and z in the site's frame, metres.

    Between two points it went straight. A robot that stood has a point at the end of that, too.
    """

    robot: str
    points: tuple[tuple[float, float, float, float], ...]


class RehearsalResult(msgspec.Struct, frozen=True, omit_defaults=True):
    """How a rehearsal went. ``seconds`` are simulated, ``took`` those of the computer.

    ``outcome`` is that of the run. ``troubles``: why it is no pass, empty when it is one. ``assumed``: what
    a rehearsal cannot show and took for granted. ``pass_until`` is the Unix time until which the edge lets
    the mission be started by it, 0 when it does not. ``tracks``: those of robots in roles, as far as they are
    placed in the site's frame.
    """

    mission: str
    outcome: str
    seconds: float
    reason: str = ""
    troubles: tuple[str, ...] = ()
    robots: tuple[RehearsedRobot, ...] = ()
    timeline: tuple[RehearsedPart, ...] = ()
    notes: tuple[RehearsalNote, ...] = ()
    approaches: tuple[Approach, ...] = ()
    assumed: tuple[str, ...] = ()
    seed: int = 1
    took: float = 0.0
    pass_until: float = 0.0
    tracks: tuple[RehearsedTrack, ...] = ()

    @property
    def passed(self) -> bool:
        """True when nothing speaks against starting the mission."""
        return not self.troubles


class RehearsalState(msgspec.Struct, frozen=True, omit_defaults=True):
    """A rehearsal, now; the answer to who asks for one, or for how it goes.

    ``refusal``: why there is none. ``seconds`` are simulated, ``notes`` those since the last question.
    """

    id: str = ""
    refusal: str = ""
    roles: dict[str, list[str]] = {}
    seconds: float = 0.0
    step: str = ""
    notes: tuple[RehearsalNote, ...] = ()
    result: RehearsalResult | None = None
    failure: str = ""


class RehearsalAsk(msgspec.Struct, frozen=True):
    """Tell how a rehearsal goes; ``since``: how many notes are known."""

    id: str
    since: int = 0


class Passed(msgspec.Struct, frozen=True):
    """A rehearsal that was passed, as the edge keeps it; ``stamp`` is Unix seconds.

    ``places`` are where the robots of its roles were, metres, as their states tell it.
    """

    mission: str
    program: str
    config: str
    roles: dict[str, list[str]]
    places: dict[str, Point]
    stamp: float


def digest(*parts: Any) -> str:
    """Return what stands for data that is the same only if this is."""
    return hashlib.blake2b(msgspec.json.encode(parts), digest_size=16).hexdigest()


def program_digest(program: Program) -> str:
    """Return what stands for what is carried out: the mission with its inputs and files."""
    return digest(program)


class Present(msgspec.Struct, frozen=True):
    """What a pass is compared with: what is to be started now, where everybody is now, and the time (Unix s).

    ``roles`` are None while they cannot be filled yet; then they and the places are not compared.
    """

    program: Program
    config: str
    now: float
    places: Mapping[str, Point | None]
    roles: Mapping[str, Sequence[str]] | None


def refusal(passes: Iterable[Passed], present: Present) -> str:
    """Return why none of the passes lets a mission be started; empty when one does. The newest come first."""
    wanted = program_digest(present.program)
    reasons = [why_stale(passed, present) for passed in passes if passed.program == wanted]
    if not all(reasons):
        return ""
    return reasons[0] if reasons else "nobody has rehearsed it with these inputs"


def why_stale(passed: Passed, present: Present) -> str:
    """Return why a pass of the same program does not let it be started now; empty when it does."""
    roles = present.roles
    if passed.config != present.config:
        return "fleet.yaml has changed since the rehearsal"
    if not 0.0 <= present.now - passed.stamp <= FRESH:
        return "the rehearsal is more than an hour old"
    if roles is not None and passed.roles != {role: list(names) for role, names in roles.items()}:
        was = "; ".join(f"{role}: {', '.join(names)}" for role, names in passed.roles.items())
        return f"it was rehearsed with others: {was}"
    return _moved(passed, present.places) if roles is not None else ""


def _moved(passed: Passed, places: Mapping[str, Point | None]) -> str:
    """Return which robot is not where it was; empty when all are."""
    for robot, was in passed.places.items():
        now = places.get(robot)
        if now is None:
            return f"nobody knows where {robot} is"
        metres = math.dist(was, now)
        if metres > NEAR:
            return f"{robot} is {metres:.1f} m from where it was at the rehearsal"
    return ""
