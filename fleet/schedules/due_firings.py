"""Decision on the due firings of one schedule; pure."""

from __future__ import annotations

import msgspec

from fleet.schedules.triggers import Trigger, firings

MOST = 1000
"""Limit for counting missed firings after an interruption; beyond it the count is a lower bound."""


class DueFirings(msgspec.Struct, frozen=True):
    """Firings between two instants: at most one is ``due`` for a start.

    ``skipped`` firings each have a reason. ``missed`` counts those that are too late (``MOST``: at least that
    many); the first of them was due at ``first_missed``.
    """

    due: float | None = None
    skipped: tuple[tuple[float, str], ...] = ()
    missed: int = 0
    first_missed: float = 0.0


def due_firings(trigger: Trigger, seen: float, now: float, *, late: float, once: bool) -> DueFirings:
    """Return the firings after ``seen``, up to and including ``now`` (Unix s).

    A firing may be started for ``late`` seconds; later it is missed. Of several, only the newest is started.
    ``once``: if all were missed, one start replaces them, due at the last one counted.
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
    return DueFirings(due, skipped, number, missed[0] if number else 0.0)
