"""Filter for queries of the history. Imports little, because the command line's ``stop`` loads it too."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from fleet.history.record import Record

MOST = 10_000  # maximum number of events in one answer


class EventFilter(msgspec.Struct, frozen=True, omit_defaults=True):
    """Selects the events of ``robots`` (empty: all), from ``since`` (Unix s) on, the newest ``most``."""

    robots: tuple[str, ...] = ()
    since: float = 0.0
    most: int = 1000

    def has(self, record: Record) -> bool:
        """Return True when the filter selects an event; ``most`` is not applied."""
        return record.stamp >= self.since and (not self.robots or record.robot in self.robots)


def newest(records: Iterable[Record], wanted: EventFilter) -> list[Record]:
    """Return the selected records of several sources, the oldest first, without duplicates."""
    found = {_same(record): record for record in records if wanted.has(record)}
    ordered = sorted(found.values(), key=lambda record: record.stamp)
    return ordered[-min(wanted.most, MOST) :]


def _same(record: Record) -> tuple[object, ...]:
    """Return the fields that identify an event."""
    return record.edge, record.stamp, record.robot, record.kind, record.text, record.request
