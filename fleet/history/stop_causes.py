"""Which event set the emergency stop of a robot; pure."""

from __future__ import annotations

from collections.abc import Iterable

from fleet.history.record import Record
from fleet.model.event import EventKind
from fleet.wire.stops import EMERGENCY

_SETS = {EventKind.STOP, EventKind.EMERGENCY_STOP}


def stop_causes(records: Iterable[Record]) -> dict[tuple[str, str], Record]:
    """Return what set the stop of each robot, by edge and name: the first stop since the last release.

    ``records`` are in the order of their time. Robots that were released since are not in it.
    """
    causes: dict[tuple[str, str], Record] = {}
    for record in records:
        robot = (record.edge, record.robot)
        if record.kind is EventKind.RELEASE:
            causes.pop(robot, None)
        elif record.kind in _SETS and record.command == EMERGENCY:
            known = causes.get(robot)
            if known is None or (_is_surer(record, known) and record.stamp - known.stamp < 1.0):
                causes[robot] = record
    return causes


def _is_surer(one: Record, other: Record) -> bool:
    """Return whether one event says more surely who asked than another."""
    return bool(one.asker and one.asker.proven) and not (other.asker and other.asker.proven)
