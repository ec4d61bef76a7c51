"""The state of one run, and what comes into the engine and goes out of it.

Everything that must outlive the process is in ``Head``, ``Member`` and ``Part``. Times are seconds of the
run's own clock, which begins at 0 with the run and goes on over restarts.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

import msgspec

from fleet.missions.program import Act, Do, Instruction, Program, Require


class Outcome(enum.StrEnum):
    """How a robot's part ended, or why the robot left the run."""

    DONE = "done"
    REFUSED = "refused"  # the host or the robot said no, or it does not have what is required
    FAILED = "failed"
    LATE = "late"  # not done in time
    LOST = "lost"  # it does not answer
    TAKEN = "taken"  # a person, a pilot or the battery policy took it
    STOPPED = "stopped"  # its emergency stop was set
    SKIPPED = "skipped"  # ended because others were through
    UNKNOWN = "unknown"  # nobody saw


class RunOutcome(enum.StrEnum):
    """How a run ended."""

    COMPLETED = "completed"
    WITH_LOSSES = "completed_with_losses"
    FAILED = "failed"
    UNDONE = "undone"
    UNDO_FAILED = "undo_failed"
    ABORTED = "aborted"
    UNKNOWN = "unknown"


class Phase(enum.StrEnum):
    """Where a run is in its life."""

    NEW = "new"  # recorded, nothing begun
    FILLING = "filling"  # a spare is asked to take the place of a robot that is lost
    OCCUPYING = "occupying"  # it waits for its places; nothing is begun
    PREPARING = "preparing"  # robots are asked whether they could; nobody moves
    STEP = "step"  # robots do something
    WAITING = "waiting"  # a time or a condition
    ASKING = "asking"  # a person
    PAUSED = "paused"
    HALTING = "halting"  # its robots are brought to a standstill before it is undone
    UNDOING = "undoing"
    ENDING = "ending"  # its robots are held, or do what on_abort says
    ENDED = "ended"


NEXT: Mapping[Phase, frozenset[Phase]] = MappingProxyType(
    {
        Phase.NEW: frozenset(Phase) - {Phase.NEW},
        Phase.FILLING: frozenset(Phase) - {Phase.NEW},
        Phase.OCCUPYING: frozenset(Phase) - {Phase.NEW},
        Phase.PREPARING: frozenset(Phase) - {Phase.NEW},
        Phase.STEP: frozenset(Phase) - {Phase.NEW},
        Phase.WAITING: frozenset(Phase) - {Phase.NEW},
        Phase.ASKING: frozenset(Phase) - {Phase.NEW},
        Phase.PAUSED: frozenset(Phase) - {Phase.NEW},
        Phase.HALTING: frozenset({Phase.HALTING, Phase.UNDOING, Phase.ENDING, Phase.ENDED}),
        Phase.UNDOING: frozenset({Phase.UNDOING, Phase.ENDING, Phase.ENDED}),
        Phase.ENDING: frozenset({Phase.ENDING, Phase.ENDED}),
        Phase.ENDED: frozenset(),
    }
)
"""What may follow each phase: from the ending nothing leads back, and nothing follows the end."""

GOING_ON = frozenset(
    {
        Phase.NEW,
        Phase.OCCUPYING,
        Phase.FILLING,
        Phase.PREPARING,
        Phase.STEP,
        Phase.WAITING,
        Phase.ASKING,
        Phase.PAUSED,
    }
)
"""The phases in which the mission itself is still carried out."""

Kind = Literal["do", "halt", "secure", "undo", "abort"]


class Member(msgspec.Struct):
    """One robot of a run. ``ours``: the run may command it. ``within``: it still takes part.

    A robot that failed is no longer within, but ours: it is held, and undone. One that was taken, stopped or
    lost is not ours, and is never commanded again. ``index`` is its place among the robots of its role,
    ``plays`` that in each role of a mission within the mission, the role before ``all``. A ``spare`` is
    neither ours nor within until it takes the place of another, which is ``replaced`` then.
    """

    robot: str
    role: str
    index: int
    plays: dict[str, int] = {}
    ours: bool = True
    within: bool = True
    outcome: Outcome | None = None
    reason: str = ""
    since: float = 0.0
    paused_at: tuple[float, float, float] | None = None
    spare: bool = False
    replaced: bool = False


class Part(msgspec.Struct):
    """What one robot does for a step: one command, with an identity that is used once for ever."""

    identity: str
    step: str
    robot: str
    role: str
    attempt: int
    kind: Kind
    act: Act
    began: float
    until: float
    outcome: Outcome | None = None
    reason: str = ""
    ended: float = 0.0

    @property
    def inflight(self) -> bool:
        """True until its end was seen, or it was given up."""
        return self.outcome is None


class Question(msgspec.Struct, frozen=True):
    """A question to a person; ``about``: what its answer decides."""

    id: int
    text: str
    until: float
    on_timeout: Literal["continue", "abort", "fail"]
    about: Literal["step", "robot", "restart", "resume"] = "step"


class Begun(msgspec.Struct, frozen=True):
    """A step that robots began: its index in the program, and its name."""

    at: int
    step: str


class Head(msgspec.Struct):
    """Where a run is. ``at`` is the index of its instruction, ``loops`` counts rounds by index.

    ``entered`` has, by index, when each mission within it began that is under way.
    """

    phase: Phase = Phase.NEW
    at: int = 0
    serial: int = 0  # of the step that is under way: a step that is repeated begins anew
    loops: dict[str, int] = {}
    entered: dict[str, float] = {}
    until: float = 0.0  # of a wait
    enlists: str = ""  # the spare that is asked
    waits_for: str = ""  # the place that it waits for, and who has it
    question: Question | None = None
    questions: int = 0
    paused_from: Phase = Phase.NEW
    paused_at: float = 0.0
    begun: list[Begun] = []  # to be undone backwards
    target: RunOutcome | None = None  # how it ends once its robots are held
    outcome: RunOutcome | None = None
    reason: str = ""


def instruction_of(program: Program, head: Head) -> Instruction | None:
    """Return the instruction that is under way; None behind the last."""
    return program.steps[head.at] if head.at < len(program.steps) else None


def required(program: Program, head: Head) -> Require:
    """Return what the step that is under way requires of its robots."""
    step = instruction_of(program, head)
    return (isinstance(step, Do) and step.require) or program.require


def step_name(program: Program, head: Head) -> str:
    """Return the step that is under way, as parts name it: a repeated one has another number each time."""
    if head.at >= len(program.steps):
        return "end"
    return f"{program.steps[head.at].id or 'repeat'}.{head.serial}"


# -- events in ---------------------------------------------------------------------------------------------


class Start(msgspec.Struct, frozen=True):
    """The run begins."""


class Restarted(msgspec.Struct, frozen=True):
    """The process that carried out the run ended; this is another one."""


class Tick(msgspec.Struct, frozen=True):
    """Time has passed."""


class Replied(msgspec.Struct, frozen=True):
    """What became of a part: None for a receipt, which shows that the robot took it."""

    identity: str
    outcome: Outcome | None
    reason: str = ""


class Prepared(msgspec.Struct, frozen=True):
    """Whether a robot could begin; ``refusal`` is empty when it could."""

    robot: str
    refusal: str = ""


class NotStarted(msgspec.Struct, frozen=True):
    """The robots of a step that were to begin together do not: nobody has moved."""

    step: str
    reason: str


class Enlisted(msgspec.Struct, frozen=True):
    """Whether a spare has joined the run; ``refusal`` is empty when it has."""

    robot: str
    refusal: str = ""


class Occupied(msgspec.Struct, frozen=True):
    """Its places are its own; or which it waits for (``waits_for``), or why it gets none (``late``)."""

    waits_for: str = ""
    late: str = ""


class Facts(msgspec.Struct, frozen=True):
    """What is seen of a robot: ``position`` in metres, ``progress`` a word that changes as it gets on."""

    robot: str
    health: str = "ok"
    battery: float | None = None
    position: tuple[float, float, float] | None = None
    progress: str = ""


class Heard(msgspec.Struct, frozen=True):
    """An event was reported of a robot."""

    robot: str
    event: str


class Left(msgspec.Struct, frozen=True):
    """A robot left the run: it was lost, taken or stopped."""

    robot: str
    outcome: Outcome
    reason: str


class Answer(msgspec.Struct, frozen=True):
    """A person answered a question."""

    question: int
    goes_on: bool
    by: str = ""


class Pause(msgspec.Struct, frozen=True):
    """A person wants the run to pause; or a ``robot`` did not pause or go on with it."""

    by: str = ""
    robot: str = ""
    reason: str = ""


class Resume(msgspec.Struct, frozen=True):
    """A person wants the run to go on."""

    by: str = ""


class Abort(msgspec.Struct, frozen=True):
    """A person wants the run to end."""

    by: str = ""


class StopAll(msgspec.Struct, frozen=True):
    """An emergency stop of a group, an edge or everything: the run ends, and nothing is undone."""

    robots: tuple[str, ...]
    reason: str = ""


Event = (
    Start
    | Restarted
    | Tick
    | Replied
    | Prepared
    | Occupied
    | Enlisted
    | NotStarted
    | Facts
    | Heard
    | Left
    | Answer
    | Pause
    | Resume
    | Abort
    | StopAll
)


class Begin(msgspec.Struct, frozen=True):
    """Command a robot, once the part is recorded."""

    part: Part


class Enlist(msgspec.Struct, frozen=True):
    """Ask a spare to join the run."""

    robot: str


class Dismiss(msgspec.Struct, frozen=True):
    """Give back a spare that has joined when it was not needed any more."""

    robot: str


class Occupy(msgspec.Struct, frozen=True):
    """Take the places of the run, or wait for them."""


class Prepare(msgspec.Struct, frozen=True):
    """Let a robot be ready to begin something at the common instant; it must not move before."""

    robot: str
    act: Act
    identity: str


class BeginTogether(msgspec.Struct, frozen=True):
    """Let robots that are prepared begin at one instant, once their parts are recorded."""

    step: str
    parts: tuple[Part, ...]


class Hold(msgspec.Struct, frozen=True):
    """Pause what a robot does for a part; ``resumes``: go on with it instead."""

    part: Part
    resumes: bool = False


class EmergencyStop(msgspec.Struct, frozen=True):
    """Set the emergency stop of robots (on_failure: stop)."""

    robots: tuple[str, ...]
    reason: str


class Note(msgspec.Struct, frozen=True):
    """One line of the run's story."""

    text: str
    robot: str = ""
    step: str = ""


class Ended(msgspec.Struct, frozen=True):
    """The run has ended; its robots are free."""

    outcome: RunOutcome
    reason: str


Effect = Begin | BeginTogether | Occupy | Enlist | Dismiss | Prepare | Hold | EmergencyStop | Note | Ended
