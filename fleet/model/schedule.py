"""Schedules: their states, and requests and answers about them on the bus. Times are Unix seconds."""

from __future__ import annotations

from typing import Literal

import msgspec


class Firing(msgspec.Struct, frozen=True, omit_defaults=True):
    """One firing: when it was ``due``, its ``state``, the ``reason`` why it was skipped, or its ``run``.

    The states are due (recorded, neither started nor skipped yet), started and skipped. ``recorded``: time of
    its record, before its start.
    """

    schedule: str
    due: float
    state: str = "due"
    reason: str = ""
    run: str = ""
    recorded: float = 0.0

    @property
    def key(self) -> str:
        """Return the id of the firing, by which it is started only once."""
        return f"{self.schedule}@{self.due:.3f}"


class ScheduleState(msgspec.Struct, frozen=True, omit_defaults=True):
    """A schedule: whether it is enabled, its next firing, a waiting one, and the last ones."""

    name: str
    mission: str
    trigger: str
    enabled: bool
    next: float | None = None
    waiting: float | None = None
    last: tuple[Firing, ...] = ()


class ScheduleRequest(msgspec.Struct, frozen=True, omit_defaults=True):
    """Request about the schedules of an edge, or one of them by ``name``; ``by`` is the sender."""

    do: Literal["list", "enable", "disable", "run"] = "list"
    name: str = ""
    by: str = ""


class ScheduleAnswer(msgspec.Struct, frozen=True, omit_defaults=True):
    """The schedules after the request, or why it was refused."""

    schedules: tuple[ScheduleState, ...] = ()
    refusal: str = ""
