"""What is to be done about the firings of one schedule up to now; pure."""

from __future__ import annotations

import msgspec

from fleet.schedules.triggers import Trigger, firings

MOST = 1000
"""Missed firings that are counted after an interruption; of more it is told that there are so many."""


class Look(msgspec.Struct, frozen=True):
    """What came due between two instants: ``due`` is to be started (None: nothing), as the one of them all.

    ``skipped`` have each a reason. ``missed`` counts those that are too late (``MOST``: so many at least),
    the first of which was due at ``first_missed``.
    """

    due: float | None = None
    skipped: tuple[tuple[float, str], ...] = ()
    missed: int = 0
    first_missed: float = 0.0


def look(trigger: Trigger, seen: float, now: float, *, late: float, once: bool) -> Look:
    """Return what came due after ``seen``, up to and with ``now`` (Unix s).

    A firing may be started for ``late`` seconds; later it is missed. Of several only the newest is started,
    never all. ``once``: where all were missed, one start makes up for them, due when the last one counted
    was.
    """
    missed: list[float] = []
    if seen < now - late:
        for at in firings(trigger, seen):
            if at >= now - late or len(missed) == MOST:
                break
            missed.append(at)
    fresh: list[float] = []
    for at in firings(trigger, max(seen, now - late - 1e-6)):
        if at > now:
            break
        fresh = [*fresh[-MOST:], at]
    made_up = missed[-1] if once and missed and not fresh else None
    due = fresh[-1] if fresh else made_up
    skipped = tuple((at, "a later one was due as well") for at in fresh[:-1])
    number = len(missed) - (made_up is not None)
    return Look(due, skipped, number, missed[0] if number else 0.0)
