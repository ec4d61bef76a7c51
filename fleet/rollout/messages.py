"""What stands in the store of roll-outs, and how it is read: desired and observed state, the roll-out."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, TypeVar

import msgspec
from msgspec import Meta

from fleet.errors import StateError
from fleet.rollout.waves import Progress
from fleet.runtime.decoding import decode_json
from fleet.runtime.state_format import format_of

FORMAT = 1
LARGEST = 1 << 20  # bytes of one entry
MOST_LINES = 50  # of changes that an edge reports
LONGEST_LINE = 200  # characters
LONGEST_WHY = 500  # characters
LONGEST_SETTLE = 600.0  # s

Id = Annotated[str, Meta(max_length=64)]
Address = Annotated[str, Meta(pattern="^([0-9a-f]{64})?$")]
"""The address of a bundle; empty for none."""

T = TypeVar("T", bound=msgspec.Struct)


class Stage(StrEnum):
    """How far an edge is with the bundle that it shall run."""

    TAKING = "taking"  # it fetches and checks it
    WAITING = "waiting"  # it is in place; a part of it waits, and why
    DONE = "done"  # the edge runs with it, and is no less healthy than before
    RETURNING = "returning"  # the one before is in place again; a part of that waits
    FAILED = "failed"  # the edge runs with the one before
    REFUSED = "refused"  # nothing was touched
    WITHDRAWN = "withdrawn"  # the roll-out ended before the edge was done; it runs with the one before


SETTLED = frozenset({Stage.DONE, Stage.FAILED, Stage.REFUSED, Stage.WITHDRAWN})


class Desired(msgspec.Struct, frozen=True):
    """What an edge shall run, as the roll-out ``rollout`` wants it.

    ``bundle`` is an address, in ``parts`` parts in the store. ``settle``: for how many seconds the edge is
    watched; at their end it must be as healthy with it as before. ``by``: who rolls out. ``withdrawn``: no
    longer, if the edge is not done.
    """

    rollout: Id
    bundle: Address
    parts: Annotated[int, Meta(ge=1, le=1000)]
    settle: Annotated[float, Meta(ge=0, le=LONGEST_SETTLE)] = 0.0
    by: Annotated[str, Meta(max_length=256)] = ""
    withdrawn: bool = False
    format: int = FORMAT


class Observed(msgspec.Struct, frozen=True):
    """What an edge reports: how far it is with ``bundle`` of ``rollout``, and what it runs with.

    ``lines`` say what changed, one line for each robot or section; ``health`` is that of the edge.
    """

    edge: Id
    rollout: Id
    bundle: Address
    stage: Stage
    why: Annotated[str, Meta(max_length=LONGEST_WHY)] = ""
    lines: Annotated[
        tuple[Annotated[str, Meta(max_length=LONGEST_LINE)], ...], Meta(max_length=MOST_LINES)
    ] = ()
    running: Address = ""
    version: int = 0
    health: Id = ""
    stamp: float = 0.0
    fleet: Id = ""
    format: int = FORMAT


class Target(msgspec.Struct, frozen=True):
    """The bundle of one edge in a roll-out."""

    bundle: str
    parts: int
    version: int


class Rollout(msgspec.Struct, frozen=True):
    """A roll-out; ``waves`` and ``stop_if`` as they were given, ``progress`` how far it is."""

    id: str
    by: str
    began: float
    waves: str
    stop_if: str
    parallel: int
    within: float
    settle: float
    targets: dict[str, Target]
    progress: Progress
    format: int = FORMAT


def read_entry(data: bytes, kind: type[T], place: str) -> T:
    """Return an entry of the store; raises StateError."""
    if len(data) > LARGEST:
        raise StateError(f"{place} has more than {LARGEST >> 20} MiB")
    try:
        found = format_of(data)
        if found > FORMAT:
            raise StateError(f"{place} has format {found}; this fleet reads {FORMAT}: update it")
        return decode_json(data, kind)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise StateError(f"{place} cannot be read: {error}") from None
