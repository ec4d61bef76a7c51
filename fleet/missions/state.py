"""The state of one run, and the events and effects of the engine.

State that must survive the process is in ``Head``, ``RunMember`` and ``StepPart``. Times are seconds of the
run's own clock, which starts at 0 with the run and continues across restarts.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

import msgspec

from fleet.missions.program import Act, Do, Instruction, Program, Require


class PartOutcome(enum.StrEnum):
    """How a robot's part ended, or why the robot left the run."""

    DONE = "done"
    REFUSED = "refused"  # by the host or the robot, or because of a requirement
    FAILED = "failed"
    LATE = "late"  # not done in time
    LOST = "lost"  # it does not answer
    TAKEN = "taken"  # by a person, a pilot or the battery policy
    STOPPED = "stopped"  # its emergency stop was set
    SKIPPED = "skipped"  # ended because the others had finished
    UNKNOWN = "unknown"  # not observed


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
    """The phases of a run."""

    NEW = "new"  # recorded, nothing begun
    FILLING = "filling"  # a spare is asked to replace a lost robot
    OCCUPYING = "occupying"  # it waits for its places; nothing is begun
    PREPARING = "preparing"  # robots report whether they can begin; none moves
    STEP = "step"  # robots act
    WAITING = "waiting"  # for a time or a condition
    ASKING = "asking"  # waits for a person's answer
    PAUSED = "paused"
    HALTING = "halting"  # its robots are halted before the undo
    UNDOING = "undoing"
    ENDING = "ending"  # its robots are held, or execute on_abort
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
"""Permitted transitions: no way back from the ending, and none from the end."""

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
"""The phases in which the mission itself is executed."""

PartKind = Literal["do", "halt", "secure", "undo", "abort"]


class RunMember(msgspec.Struct):
    """One robot of a run. ``ours``: the run may command it. ``within``: it still takes part.

    A robot that failed no longer takes part, but is ours: it is held and undone. A robot that was taken,
    stopped or lost is not ours, and is never commanded again. ``index`` is its position among the robots of
    its role, ``plays`` its positions in the roles of inner missions, the role before ``all``. A ``spare`` is
    neither ours nor within until it replaces another robot, which is then marked ``replaced``.
    """

    robot: str
    role: str
    index: int
    plays: dict[str, int] = {}
    ours: bool = True
    within: bool = True
    outcome: PartOutcome | None = None
    reason: str = ""
    since: float = 0.0
    paused_at: tuple[float, float, float] | None = None
    spare: bool = False
    replaced: bool = False


class StepPart(msgspec.Struct):
    """One robot's part in a step: one command, with an identity that is used only once."""

    identity: str
    step: str
    robot: str
    role: str
    attempt: int
    kind: PartKind
    act: Act
    began: float
    until: float
    outcome: PartOutcome | None = None
    reason: str = ""
    ended: float = 0.0

    @property
    def inflight(self) -> bool:
        """True until its end is observed or it is given up."""
        return self.outcome is None


class Question(msgspec.Struct, frozen=True):
    """A question to a person; ``about``: the subject of the decision."""

    id: int
    text: str
    until: float
    on_timeout: Literal["continue", "abort", "fail"]
    about: Literal["step", "robot", "restart", "resume"] = "step"


class UndoableStep(msgspec.Struct, frozen=True):
    """A started step: its index in the program, and its name."""

    at: int
    step: str


class RunHead(msgspec.Struct):
    """Position and phase of a run."""

    phase: Phase = Phase.NEW
    at: int = 0  # index of the instruction
    serial: int = 0  # of the present step: a repeated step gets a new number
    loops: dict[str, int] = {}  # rounds, by index of the loop
    entered: dict[str, float] = {}  # start of each inner mission in progress, by index
    until: float = 0.0  # of a wait
    enlists: str = ""  # the spare that is asked to join
    waits_for: str = ""  # the awaited place, with its holder
    question: Question | None = None
    questions: int = 0
    paused_from: Phase = Phase.NEW
    paused_at: float = 0.0
    # undone in reverse order
    undoable: list[UndoableStep] = msgspec.field(name="begun", default_factory=list)
    target: RunOutcome | None = None  # its outcome once its robots are held
    outcome: RunOutcome | None = None
    reason: str = ""


def instruction_of(program: Program, head: RunHead) -> Instruction | None:
    """Return the present instruction; None after the last."""
    return program.steps[head.at] if head.at < len(program.steps) else None


def required(program: Program, head: RunHead) -> Require:
    """Return the requirements of the present step."""
    step = instruction_of(program, head)
    return (isinstance(step, Do) and step.require) or program.require


def step_name(program: Program, head: RunHead) -> str:
    """Return the name of the present step as used in parts: each repetition has another number."""
    if head.at >= len(program.steps):
        return "end"
    return f"{program.steps[head.at].id or 'repeat'}.{head.serial}"


# -- events ------------------------------------------------------------------------------------------------


class Start(msgspec.Struct, frozen=True):
    """The run begins."""


class Restarted(msgspec.Struct, frozen=True):
    """Another process resumes the run after the end of the first."""


class Tick(msgspec.Struct, frozen=True):
    """Time has passed."""


class Replied(msgspec.Struct, frozen=True):
    """The outcome of a part; None for a receipt, which shows that the robot accepted it."""

    identity: str
    outcome: PartOutcome | None
    reason: str = ""


class RobotPrepared(msgspec.Struct, frozen=True):
    """Whether a robot can begin; ``refusal`` is empty if it can."""

    robot: str
    refusal: str = ""


class NotStarted(msgspec.Struct, frozen=True):
    """The coordinated start of a step failed: no robot has moved."""

    step: str
    reason: str


class Enlisted(msgspec.Struct, frozen=True):
    """Whether a spare has joined the run; ``refusal`` is empty if it has."""

    robot: str
    refusal: str = ""


class PlaceOccupied(msgspec.Struct, frozen=True):
    """The run occupies its places; or the awaited place (``waits_for``), or why it gets none (``late``)."""

    waits_for: str = ""
    late: str = ""


class Facts(msgspec.Struct, frozen=True):
    """Observed facts of a robot: ``position`` in metres, ``progress`` a text that changes as it moves on."""

    robot: str
    health: str = "ok"
    battery: float | None = None
    position: tuple[float, float, float] | None = None
    progress: str = ""


class RobotEvent(msgspec.Struct, frozen=True):
    """A robot reported an event."""

    robot: str
    event: str


class Left(msgspec.Struct, frozen=True):
    """A robot left the run: it was lost, taken or stopped."""

    robot: str
    outcome: PartOutcome
    reason: str


class PersonAnswer(msgspec.Struct, frozen=True):
    """A person answered a question."""

    question: int
    goes_on: bool
    by: str = ""


class Pause(msgspec.Struct, frozen=True):
    """A person pauses the run; or a ``robot`` did not pause or resume with it."""

    by: str = ""
    robot: str = ""
    reason: str = ""


class Resume(msgspec.Struct, frozen=True):
    """A person resumes the run."""

    by: str = ""


class Abort(msgspec.Struct, frozen=True):
    """A person aborts the run."""

    by: str = ""


class StopAll(msgspec.Struct, frozen=True):
    """An emergency stop of a group, an edge or everything: the run ends, and nothing is undone."""

    robots: tuple[str, ...]
    reason: str = ""


RunEvent = (
    Start
    | Restarted
    | Tick
    | Replied
    | RobotPrepared
    | PlaceOccupied
    | Enlisted
    | NotStarted
    | Facts
    | RobotEvent
    | Left
    | PersonAnswer
    | Pause
    | Resume
    | Abort
    | StopAll
)


class Begin(msgspec.Struct, frozen=True):
    """Command a robot, after the part is recorded."""

    part: StepPart


class Enlist(msgspec.Struct, frozen=True):
    """Ask a spare to join the run."""

    robot: str


class Dismiss(msgspec.Struct, frozen=True):
    """Release a spare that joined when it was no longer needed."""

    robot: str


class Occupy(msgspec.Struct, frozen=True):
    """Occupy the places of the run, or wait for them."""


class Prepare(msgspec.Struct, frozen=True):
    """Prepare a robot to begin at the common instant; it must not move before."""

    robot: str
    act: Act
    identity: str


class BeginTogether(msgspec.Struct, frozen=True):
    """Let prepared robots begin at one instant, after their parts are recorded."""

    step: str
    parts: tuple[StepPart, ...]


class Hold(msgspec.Struct, frozen=True):
    """Pause a robot's part; ``resumes``: resume it instead."""

    part: StepPart
    resumes: bool = False


class EmergencyStop(msgspec.Struct, frozen=True):
    """Set the emergency stop of robots (on_failure: stop)."""

    robots: tuple[str, ...]
    reason: str


class LogNote(msgspec.Struct, frozen=True):
    """One line of the run's log."""

    text: str
    robot: str = ""
    step: str = ""


class Ended(msgspec.Struct, frozen=True):
    """The run has ended; its robots are released."""

    outcome: RunOutcome
    reason: str


RunEffect = (
    Begin | BeginTogether | Occupy | Enlist | Dismiss | Prepare | Hold | EmergencyStop | LogNote | Ended
)
