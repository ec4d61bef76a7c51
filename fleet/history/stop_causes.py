"""The events that set the emergency stops of robots; pure."""

from __future__ import annotations

from collections.abc import Iterable

from fleet.history.record import Record
from fleet.model.event import EventKind
from fleet.wire.stops import EMERGENCY

_SETS = {EventKind.STOP, EventKind.EMERGENCY_STOP}


def stop_causes(records: Iterable[Record]) -> dict[tuple[str, str], Record]:
    """Return the event that set the stop of each robot (edge, name): the first stop since its release.

    ``records`` are in order of time. Robots without a stop since their last release are left out.
    """
    causes: dict[tuple[str, str], Record] = {}
    for record in records:
        robot = (record.edge, record.robot)
        if record.kind is EventKind.RELEASE:
            causes.pop(robot, None)
        elif record.kind in _SETS and record.command == EMERGENCY:
            known = causes.get(robot)
            if known is None or (_is_better_proven(record, known) and record.stamp - known.stamp < 1.0):
                causes[robot] = record
    return causes


def _is_better_proven(one: Record, other: Record) -> bool:
    """Return whether only the first of two events has a proven requester."""
    return bool(one.asker and one.asker.proven) and not (other.asker and other.asker.proven)
