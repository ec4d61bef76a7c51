"""Schedules as programs and people see them, and what is asked of them on the bus. Times are Unix seconds."""

from __future__ import annotations

from typing import Literal

import msgspec


class Firing(msgspec.Struct, frozen=True, omit_defaults=True):
    """One firing: when it was ``due``, its ``state``, why it was skipped, or its run.

    The states are due (recorded, and neither started nor skipped yet), started and skipped. ``recorded``:
    when it was written, before it was started.
    """

    schedule: str
    due: float
    state: str = "due"
    reason: str = ""
    run: str = ""
    recorded: float = 0.0

    @property
    def key(self) -> str:
        """Return what makes a start of it known: the same one is started once."""
        return f"{self.schedule}@{self.due:.3f}"


class ScheduleState(msgspec.Struct, frozen=True, omit_defaults=True):
    """A schedule: whether it is on, when it fires next, which firing waits, and the last ones."""

    name: str
    mission: str
    trigger: str
    enabled: bool
    next: float | None = None
    waiting: float | None = None
    last: tuple[Firing, ...] = ()


class ScheduleAsked(msgspec.Struct, frozen=True, omit_defaults=True):
    """What is asked of an edge's schedules, or of one by its ``name``; ``by`` is who asks."""

    do: Literal["list", "enable", "disable", "run"] = "list"
    name: str = ""
    by: str = ""


class ScheduleAnswer(msgspec.Struct, frozen=True, omit_defaults=True):
    """The schedules after it was done, or why it was not."""

    schedules: tuple[ScheduleState, ...] = ()
    refusal: str = ""
