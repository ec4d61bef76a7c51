"""Health of a link, robot or edge: four levels, the cause in words, and the worst of several."""

from __future__ import annotations

import enum
from collections.abc import Iterable

import msgspec


class Level(enum.IntEnum):
    """Health level; a larger value is worse."""

    OK = 0
    DEGRADED = 1  # works, but a person should know
    OFFLINE = 2  # unreachable; recovers by itself
    FAULT = 3  # does not recover by itself: a person must act

    @property
    def word(self) -> str:
        """Name of the level in lower case, as every output shows it."""
        return self.name.lower()


class Health(msgspec.Struct, frozen=True):
    """A level and its cause; the cause is empty only when the level is ok."""

    level: Level = Level.OK
    cause: str = ""


def degraded(problem: str) -> Health:
    """Return the health of something that works with a problem, or without."""
    return Health(Level.DEGRADED, problem) if problem else Health()


def worst(healths: Iterable[Health]) -> Health:
    """Return the worst health, the first of several at the same level; ok when there are none."""
    return max(healths, key=lambda health: health.level, default=Health())
