"""What the bus is told of runs, and asked, on ``fleet/{edge}/missions/...`` and ``fleet/{edge}/runs/...``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal

import msgspec

from fleet.missions.engine import Engine
from fleet.missions.state import Head, Member, Part
from fleet.missions.store import About


class StartAsk(msgspec.Struct, frozen=True, omit_defaults=True):
    """Start a mission, or (``only_fill``) show which robots would fill its roles.

    ``mission`` is one that is sent along, its files in it; left out, the edge's own of the key's name is
    meant. ``robots`` are those that a person chose for roles. ``run`` is an id of the asker's, so that a
    repeat is the same run; left out, one is made. With a ``timestamp`` (Unix s, the asker's clock) each robot
    judges the start like a command of that age; without one the start is as old as its arrival.
    """

    mission: dict[str, Any] | None = None
    inputs: dict[str, Any] = {}
    robots: dict[str, list[str]] = {}
    run: str = ""
    only_fill: bool = False
    session_id: str = ""
    source_type: str | None = None
    timestamp: float | None = None


class Started(msgspec.Struct, frozen=True, omit_defaults=True):
    """The answer: the run and its robots by role, or why it was not started."""

    run: str = ""
    roles: dict[str, list[str]] = {}
    refusal: str = ""
    hint: str = ""


class ControlAsk(msgspec.Struct, frozen=True, omit_defaults=True):
    """Control a run; ``question`` is what is answered."""

    do: Literal["pause", "resume", "abort", "answer", "log", "results"]
    question: int = 0
    goes_on: bool = False
    session_id: str = ""


class Controlled(msgspec.Struct, frozen=True, omit_defaults=True):
    """The answer: why it was refused; empty when it was taken."""

    refusal: str = ""


class RunRobot(msgspec.Struct, frozen=True, omit_defaults=True):
    """One robot of a run: what it does now, or why it is out. ``lane``: its newest parts, how they ended."""

    robot: str
    role: str
    doing: str = ""
    within: bool = True
    outcome: str = ""
    reason: str = ""
    lane: tuple[str, ...] = ()


class AskedNow(msgspec.Struct, frozen=True, omit_defaults=True):
    """A question that waits for a person; ``seconds`` are left."""

    id: int
    text: str
    seconds: float
    on_timeout: str


class RunState(msgspec.Struct, frozen=True, omit_defaults=True):
    """One run, now. ``started`` is Unix seconds, ``seconds`` how long it has run.

    ``by`` is who started it, ``way`` how he asked: a schedule is the edge's own (``mission``). ``waits_for``
    is the place that it waits for before it begins, and who has that.
    """

    run: str
    edge: str
    mission: str
    phase: str
    step: str
    started: float
    seconds: float = 0.0
    by: str = ""
    hash: str = ""
    outcome: str = ""
    reason: str = ""
    question: AskedNow | None = None
    robots: tuple[RunRobot, ...] = ()
    problem: str = ""
    way: str = "bus"
    waits_for: str = ""


class MissionState(msgspec.Struct, frozen=True, omit_defaults=True):
    """One mission that an edge knows, with what it takes."""

    name: str
    edge: str
    summary: str = ""
    inputs: dict[str, str] = {}
    roles: dict[str, str] = {}
    steps: tuple[str, ...] = ()


def state_of(engine: Engine, about: About, edge: str, seconds: float, problem: str = "") -> RunState:
    """Return what a run looks like now."""
    head = engine.head
    doing = {part.robot: part.act.words for part in engine.robots.active()}
    question = head.question
    return RunState(
        about.run,
        edge,
        about.mission,
        head.phase.value,
        engine.steps.name,
        about.started,
        round(seconds, 1),
        about.by,
        about.hash,
        head.outcome.value if head.outcome else "",
        head.reason,
        AskedNow(question.id, question.text, round(question.until - seconds, 1), question.on_timeout)
        if question
        else None,
        tuple(
            _robot(member, doing.get(member.robot, ""), engine.robots.lanes[member.robot])
            for member in engine.robots.members.values()
        ),
        problem,
        about.way,
        head.waits_for,
    )


def ended_state(about: About, head: Head, members: Iterable[Member], edge: str) -> RunState:
    """Return what a run looked like at its end."""
    return RunState(
        about.run,
        edge,
        about.mission,
        head.phase.value,
        "end",
        about.started,
        by=about.by,
        hash=about.hash,
        outcome=head.outcome.value if head.outcome else "",
        reason=head.reason,
        robots=tuple(_robot(member, "", ()) for member in members),
        way=about.way,
    )


def _robot(member: Member, doing: str, parts: Iterable[Part]) -> RunRobot:
    """Return one robot of a run."""
    outcome = member.outcome.value if member.outcome else ""
    doing = "spare" if member.spare else doing
    lane = tuple(f"{part.act.words} {part.outcome or '...'}" for part in parts)
    return RunRobot(member.robot, member.role, doing, member.within, outcome, member.reason, lane)
