"""Which events somebody wants to see. Imports little: the command line's stop has it too."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from fleet.history.record import Record

MOST = 10_000  # events of one answer


class EventFilter(msgspec.Struct, frozen=True, omit_defaults=True):
    """Which events: of ``robots`` (none: all), from ``since`` (Unix s) on, the newest ``most``."""

    robots: tuple[str, ...] = ()
    since: float = 0.0
    most: int = 1000

    def has(self, record: Record) -> bool:
        """Return whether an event is among them, but for ``most``."""
        return record.stamp >= self.since and (not self.robots or record.robot in self.robots)


def newest(records: Iterable[Record], wanted: EventFilter) -> list[Record]:
    """Return those that are wanted, the oldest first, each once: of what several places have."""
    found = {_same(record): record for record in records if wanted.has(record)}
    ordered = sorted(found.values(), key=lambda record: record.stamp)
    return ordered[-min(wanted.most, MOST) :]


def _same(record: Record) -> tuple[object, ...]:
    """Return what tells an event from others."""
    return record.edge, record.stamp, record.robot, record.kind, record.text, record.request
