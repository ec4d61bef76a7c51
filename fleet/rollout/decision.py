"""What an edge does next about the bundle that it shall run: a table, and the rule of versions. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

import msgspec

from fleet.rollout.faults import Fault
from fleet.rollout.messages import SETTLED, Desired, Stage


class Refusal(msgspec.Struct, frozen=True):
    """What an edge refused, when (Unix s) and why."""

    stamp: float
    rollout: str
    bundle: str
    why: str


class Record(msgspec.Struct, frozen=True):
    """How far an edge is, as its disk has it.

    ``running`` is the last bundle that was taken as a whole; ``highest`` the highest version that was ever
    put in place, by ``highest_bundle``. ``bundle`` and ``stage`` are of the roll-out ``rollout``, begun by
    ``by``. ``placed``: when (Unix s) the link was last changed; ``health``: that of the edge before, empty
    where it did not run, and ``faults`` what was wrong then, which must not get worse; None in a record of an
    older fleet. ``adapters`` have changed code, of which ``loaded`` was taken into use; ``files`` are
    read by a start of the edge only. ``ends``: what a return ends as.
    """

    running: str = ""
    highest: int = 0
    highest_bundle: str = ""
    rollout: str = ""
    bundle: str = ""
    by: str = ""
    stage: Stage = Stage.DONE
    ends: Stage = Stage.FAILED
    why: str = ""
    lines: tuple[str, ...] = ()
    placed: float = 0.0
    health: str = ""
    faults: tuple[Fault, ...] | None = None
    adapters: tuple[str, ...] = ()
    loaded: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    refusals: tuple[Refusal, ...] = ()
    format: int = 1


class Relation(StrEnum):
    """How what is desired stands to what the edge is at."""

    NOTHING = "nothing"  # nothing is desired, or no longer and the edge never began
    SAME = "same"
    WITHDRAWN = "withdrawn"
    OTHER = "other"


class Action(StrEnum):
    """What an edge does next."""

    REST = "rest"
    TAKE = "take"  # fetch, check, put in place, apply
    GO_ON = "go on"  # apply what waits
    RETURN = "return"  # put the bundle before in place again, apply
    GO_ON_BACK = "go on back"  # apply what of that waits
    GIVE_UP = "give up"  # nothing was touched yet


_UNTIL_IT_ENDS = dict.fromkeys(Relation, Action.GO_ON_BACK)
_SETTLED = {**dict.fromkeys(Relation, Action.REST), Relation.OTHER: Action.TAKE}
ACTIONS: Mapping[Stage, Mapping[Relation, Action]] = {
    **dict.fromkeys(SETTLED, _SETTLED),
    Stage.TAKING: {
        Relation.NOTHING: Action.GIVE_UP,
        Relation.SAME: Action.TAKE,
        Relation.WITHDRAWN: Action.GIVE_UP,
        Relation.OTHER: Action.TAKE,
    },
    Stage.WAITING: {
        Relation.NOTHING: Action.GO_ON,
        Relation.SAME: Action.GO_ON,
        Relation.WITHDRAWN: Action.RETURN,
        Relation.OTHER: Action.RETURN,  # which may be refused, and must find nothing half applied
    },
    Stage.RETURNING: _UNTIL_IT_ENDS,
}


def relation(record: Record, desired: Desired | None) -> Relation:
    """Return how what is desired stands to what the edge is at."""
    if desired is None:
        return Relation.NOTHING
    same = (desired.rollout, desired.bundle) == (record.rollout, record.bundle)
    if desired.withdrawn:
        return Relation.WITHDRAWN if same else Relation.NOTHING
    return Relation.SAME if same else Relation.OTHER


def action(record: Record, desired: Desired | None) -> Action:
    """Return what the edge does next."""
    return ACTIONS[record.stage][relation(record, desired)]


def version_refusal(record: Record, bundle: str, version: int) -> str:
    """Return why a bundle of this version is not taken; empty when it is.

    Versions only grow, so that a bundle of before, with its signature, brings no error back. What the edge
    runs already, and the same bundle again, pass.
    """
    if bundle in (record.running, record.highest_bundle) or version > record.highest:
        return ""
    return (
        f"version {version} is not newer than version {record.highest}, which this edge has had: make a "
        "bundle with a higher version, also of earlier files"
    )
