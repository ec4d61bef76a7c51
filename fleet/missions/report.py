"""Messages on ``fleet/{edge}/missions/...`` and ``fleet/{edge}/runs/...``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal

import msgspec

from fleet.missions.engine import Engine
from fleet.missions.state import RunHead, RunMember, StepPart
from fleet.missions.store import RunOrigin


class MissionStartRequest(msgspec.Struct, frozen=True, omit_defaults=True):
    """Request to start a mission, or (``only_fill``) to return the robots for its roles.

    ``mission`` is a mission with the contents of its files; without one, the edge's own mission of the key's
    name is started. ``robots`` assigns robots to roles. ``run`` is an id chosen by the sender, so that a
    repeat is the same run; without one, the edge creates an id. ``timestamp`` (Unix s, the sender's clock)
    lets each robot check the age of the start like that of a command; without one the start is as old as its
    arrival.
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
    """Reply: the run and its robots by role, or why it was not started."""

    run: str = ""
    roles: dict[str, list[str]] = {}
    refusal: str = ""
    hint: str = ""


class RunControlRequest(msgspec.Struct, frozen=True, omit_defaults=True):
    """Request to control a run; ``question`` is the id of the answered question."""

    do: Literal["pause", "resume", "abort", "answer", "log", "results"]
    question: int = 0
    goes_on: bool = False
    session_id: str = ""


class Controlled(msgspec.Struct, frozen=True, omit_defaults=True):
    """Reply: the reason of a refusal, empty if accepted."""

    refusal: str = ""


class RunRobot(msgspec.Struct, frozen=True, omit_defaults=True):
    """One robot of a run: its present act, or why it is out. ``lane``: its newest parts with outcomes."""

    robot: str
    role: str
    doing: str = ""
    within: bool = True
    outcome: str = ""
    reason: str = ""
    lane: tuple[str, ...] = ()


class PendingQuestion(msgspec.Struct, frozen=True, omit_defaults=True):
    """A pending question to a person; ``seconds`` are left."""

    id: int
    text: str
    seconds: float
    on_timeout: str


class RunState(msgspec.Struct, frozen=True, omit_defaults=True):
    """Present state of one run. ``started`` is Unix seconds, ``seconds`` its duration so far.

    ``by`` is the user who started it, ``transport`` that of the request; for a schedule it is the edge's own
    (``mission``). ``waits_for`` is the place that it waits for before it begins, with the holder.
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
    question: PendingQuestion | None = None
    robots: tuple[RunRobot, ...] = ()
    problem: str = ""
    transport: str = msgspec.field(name="way", default="bus")
    waits_for: str = ""


class MissionState(msgspec.Struct, frozen=True, omit_defaults=True):
    """A mission of an edge, with its inputs and roles."""

    name: str
    edge: str
    summary: str = ""
    inputs: dict[str, str] = {}
    roles: dict[str, str] = {}
    steps: tuple[str, ...] = ()


def state_of(engine: Engine, about: RunOrigin, edge: str, seconds: float, problem: str = "") -> RunState:
    """Return the present state of a run."""
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
        PendingQuestion(question.id, question.text, round(question.until - seconds, 1), question.on_timeout)
        if question
        else None,
        tuple(
            _robot(member, doing.get(member.robot, ""), engine.robots.shown_parts[member.robot])
            for member in engine.robots.members.values()
        ),
        problem,
        about.transport,
        head.waits_for,
    )


def ended_state(about: RunOrigin, head: RunHead, members: Iterable[RunMember], edge: str) -> RunState:
    """Return the last state of an ended run."""
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
        transport=about.transport,
    )


def _robot(member: RunMember, doing: str, parts: Iterable[StepPart]) -> RunRobot:
    """Return the state of one robot of a run."""
    outcome = member.outcome.value if member.outcome else ""
    doing = "spare" if member.spare else doing
    lane = tuple(f"{part.act.words} {part.outcome or '...'}" for part in parts)
    return RunRobot(member.robot, member.role, doing, member.within, outcome, member.reason, lane)
