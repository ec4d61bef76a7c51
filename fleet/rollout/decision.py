"""Decisions of the agent of an edge: the table of actions, and the version rule. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

import msgspec

from fleet.rollout.faults import PartFault
from fleet.rollout.messages import SETTLED, BundleStage, DesiredState


class Refusal(msgspec.Struct, frozen=True):
    """One refused bundle; ``stamp`` in Unix seconds."""

    stamp: float
    rollout: str
    bundle: str
    why: str


class AgentRecord(msgspec.Struct, frozen=True):
    """Persistent state of the agent of an edge.

    ``running``: the last bundle that was applied completely. ``highest``: the highest version that was ever
    activated, by the bundle ``highest_bundle``. ``bundle``, ``stage``: the bundle of the roll-out ``rollout``
    and its progress; ``by`` began the roll-out. ``ends``: the final stage after a rollback. ``placed``: when
    the link was last changed (Unix s). ``health``: health of the edge before the bundle, empty if it did not
    run. ``faults``: its faults at that time, which must not get worse; None in a record of an older version.
    ``adapters``: adapters with changed code, of which ``loaded`` have been reloaded. ``files``: changed files
    that the edge reads at its start only.
    """

    running: str = ""
    highest: int = 0
    highest_bundle: str = ""
    rollout: str = ""
    bundle: str = ""
    by: str = ""
    stage: BundleStage = BundleStage.DONE
    ends: BundleStage = BundleStage.FAILED
    why: str = ""
    lines: tuple[str, ...] = ()
    placed: float = 0.0
    health: str = ""
    faults: tuple[PartFault, ...] | None = None
    adapters: tuple[str, ...] = ()
    loaded: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    refusals: tuple[Refusal, ...] = ()
    format: int = 1


class Relation(StrEnum):
    """Relation of the desired bundle to the bundle in the record."""

    NOTHING = "nothing"  # no desired bundle, or one that was withdrawn before the edge began
    SAME = "same"
    WITHDRAWN = "withdrawn"
    OTHER = "other"


class AgentAction(StrEnum):
    """Next action of an agent."""

    REST = "rest"
    TAKE = "take"  # fetch, check, activate, apply
    GO_ON = "go on"  # apply the pending changes
    RETURN = "return"  # activate and apply the previous bundle
    GO_ON_BACK = "go on back"  # apply the pending changes of the rollback
    GIVE_UP = "give up"  # nothing has changed yet


_UNTIL_IT_ENDS = dict.fromkeys(Relation, AgentAction.GO_ON_BACK)
_SETTLED = {**dict.fromkeys(Relation, AgentAction.REST), Relation.OTHER: AgentAction.TAKE}
ACTIONS: Mapping[BundleStage, Mapping[Relation, AgentAction]] = {
    **dict.fromkeys(SETTLED, _SETTLED),
    BundleStage.TAKING: {
        Relation.NOTHING: AgentAction.GIVE_UP,
        Relation.SAME: AgentAction.TAKE,
        Relation.WITHDRAWN: AgentAction.GIVE_UP,
        Relation.OTHER: AgentAction.TAKE,
    },
    BundleStage.WAITING: {
        Relation.NOTHING: AgentAction.GO_ON,
        Relation.SAME: AgentAction.GO_ON,
        Relation.WITHDRAWN: AgentAction.RETURN,
        Relation.OTHER: AgentAction.RETURN,  # the other may be refused, and must find nothing half applied
    },
    BundleStage.RETURNING: _UNTIL_IT_ENDS,
}


def relation(record: AgentRecord, desired: DesiredState | None) -> Relation:
    """Return the relation of the desired bundle to the bundle in the record."""
    if desired is None:
        return Relation.NOTHING
    same = (desired.rollout, desired.bundle) == (record.rollout, record.bundle)
    if desired.withdrawn:
        return Relation.WITHDRAWN if same else Relation.NOTHING
    return Relation.SAME if same else Relation.OTHER


def action(record: AgentRecord, desired: DesiredState | None) -> AgentAction:
    """Return the next action of the agent."""
    return ACTIONS[record.stage][relation(record, desired)]


def version_refusal(record: AgentRecord, bundle: str, version: int) -> str:
    """Return why a bundle of this version is refused; empty if it is accepted.

    Versions must grow, so that an old bundle with a valid signature cannot bring back an old error. The
    bundle that the edge runs, and the one with the highest version, are accepted again.
    """
    if bundle in (record.running, record.highest_bundle) or version > record.highest:
        return ""
    return (
        f"version {version} is not newer than version {record.highest}, which this edge has had: make a "
        "bundle with a higher version, also of earlier files"
    )
