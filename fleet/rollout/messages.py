"""Entries in the store of roll-outs: desired and observed states, the roll-out."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, TypeVar

import msgspec
from msgspec import Meta

from fleet.errors import StateError
from fleet.rollout.waves import RolloutProgress
from fleet.runtime.decoding import decode_json
from fleet.runtime.state_format import format_of

FORMAT = 1
LARGEST = 1 << 20  # bytes of one entry
MOST_LINES = 50  # of changes that an edge reports
LONGEST_LINE = 200  # characters
LONGEST_WHY = 500  # characters
LONGEST_SETTLE = 600.0  # s

Id = Annotated[str, Meta(max_length=64)]
ContentAddress = Annotated[str, Meta(pattern="^([0-9a-f]{64})?$")]
"""Address of a bundle; empty for none."""

T = TypeVar("T", bound=msgspec.Struct)


class BundleStage(StrEnum):
    """Progress of an edge with its desired bundle."""

    TAKING = "taking"  # the agent fetches and checks the bundle
    WAITING = "waiting"  # the bundle is active; some of its changes are pending
    DONE = "done"  # all changes are applied, and the edge is no less healthy than before
    RETURNING = "returning"  # the previous bundle is active again; some of its changes are pending
    FAILED = "failed"  # the edge runs with the previous bundle
    REFUSED = "refused"  # nothing has changed
    WITHDRAWN = "withdrawn"  # the roll-out ended before the edge was done; it runs with the previous bundle


SETTLED = frozenset({BundleStage.DONE, BundleStage.FAILED, BundleStage.REFUSED, BundleStage.WITHDRAWN})


class DesiredState(msgspec.Struct, frozen=True):
    """Desired state of an edge in the roll-out ``rollout``.

    ``bundle``: the address of the bundle, stored in ``parts`` parts. ``settle``: observation time in seconds,
    at whose end the edge must be as healthy as before. ``by``: the operator. ``withdrawn``: the edge no
    longer has to run the bundle, and rolls back if it is not done.
    """

    rollout: Id
    bundle: ContentAddress
    parts: Annotated[int, Meta(ge=1, le=1000)]
    settle: Annotated[float, Meta(ge=0, le=LONGEST_SETTLE)] = 0.0
    by: Annotated[str, Meta(max_length=256)] = ""
    withdrawn: bool = False
    format: int = FORMAT


class ObservedState(msgspec.Struct, frozen=True):
    """Report of an edge: its progress with the bundle ``bundle`` of the roll-out ``rollout``.

    ``lines``: the changes, one line for each robot or section. ``running``: the active bundle. ``version``:
    the highest version that it has had. ``health``: health of the edge. ``stamp``: Unix s. ``fleet``: version
    of the program.
    """

    edge: Id
    rollout: Id
    bundle: ContentAddress
    stage: BundleStage
    why: Annotated[str, Meta(max_length=LONGEST_WHY)] = ""
    lines: Annotated[
        tuple[Annotated[str, Meta(max_length=LONGEST_LINE)], ...], Meta(max_length=MOST_LINES)
    ] = ()
    running: ContentAddress = ""
    version: int = 0
    health: Id = ""
    stamp: float = 0.0
    fleet: Id = ""
    format: int = FORMAT


class EdgeTarget(msgspec.Struct, frozen=True):
    """Bundle of one edge in a roll-out."""

    bundle: str
    parts: int
    version: int


class Rollout(msgspec.Struct, frozen=True):
    """A roll-out and its progress; ``waves`` and ``stop_if`` are the texts given by the operator.

    ``began`` in Unix seconds; ``within`` and ``settle`` in seconds.
    """

    id: str
    by: str
    began: float
    waves: str
    stop_if: str
    parallel: int
    within: float
    settle: float
    targets: dict[str, EdgeTarget]
    progress: RolloutProgress
    format: int = FORMAT


def read_entry(data: bytes, kind: type[T], place: str) -> T:
    """Decode an entry of the store; raises StateError."""
    if len(data) > LARGEST:
        raise StateError(f"{place} has more than {LARGEST >> 20} MiB")
    try:
        found = format_of(data)
        if found > FORMAT:
            raise StateError(f"{place} has format {found}; this fleet reads {FORMAT}: update it")
        return decode_json(data, kind)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise StateError(f"{place} cannot be read: {error}") from None
