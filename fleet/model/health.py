"""How well something is: four levels, the cause in words, and the rule that the worst one wins."""

from __future__ import annotations

import enum
from collections.abc import Iterable

import msgspec


class Level(enum.IntEnum):
    """Ordered: a larger one is worse."""

    OK = 0
    DEGRADED = 1  # works, but a person should know
    OFFLINE = 2  # cannot be reached; comes back by itself
    FAULT = 3  # does not come back by itself: a person must act

    @property
    def word(self) -> str:
        """The level in lower case, as it stands in every output."""
        return self.name.lower()


class Health(msgspec.Struct, frozen=True):
    """A level and its cause; the cause is empty only when the level is ok."""

    level: Level = Level.OK
    cause: str = ""


def degraded(problem: str) -> Health:
    """Return the health of something that works with a problem, or without."""
    return Health(Level.DEGRADED, problem) if problem else Health()


def worst(healths: Iterable[Health]) -> Health:
    """Return the worst of them, the first where several are equally bad; ok when there are none."""
    return max(healths, key=lambda health: health.level, default=Health())
