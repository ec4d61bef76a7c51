"""fleet.yaml's ``schedules``: automatic starts of missions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from fleet.model.event import EventKind
from fleet.robot_config import Name
from fleet.schedules.triggers import Trigger, cron_fields, unix_time_of, zone_of
from fleet.yaml_model import Duration, Model, wrong

Missed = Literal["skip", "once"]
Busy = Literal["skip", "queue", "replace"]
SHORTEST = 10.0  # s, shortest period
TRIGGERS = ("cron", "every", "once", "on_event")


class EventTrigger(Model):
    """An event of the edge's history that starts a mission."""

    kind: EventKind = Field(description="Its kind, as `fleet history` names it.")
    robots: tuple[Name, ...] = Field((), description="Only of these robots. None: of all.")


class ScheduleConfig(Model):
    """An automatic start of a mission: exactly one of cron, every, once and on_event."""

    mission: Name = Field(description="The mission that is started.")
    inputs: dict[str, Any] = Field({}, description="Its inputs.")
    cron: str | None = Field(
        None,
        description="minute hour day month weekday, weekdays by name: 0 6 * * mon-fri. A time that comes "
        "twice when clocks go back fires once, one that is left out fires at the end of the gap.",
    )
    every: Duration | None = Field(
        None, ge=SHORTEST, description="Period, as in 15 min; counted from 1970-01-01T00:00Z."
    )
    once: str | None = Field(None, description="A date with time, as in 2026-11-22T06:00.")
    on_event: EventTrigger | None = Field(None, description="An event of a robot.")
    timezone: str | None = Field(
        None, description="As in Europe/Zurich; needed by cron, and by once without an offset."
    )
    late: Duration = Field(
        600.0,
        description="How long after it was due it may still be started, as in 10 min; later it is missed.",
    )
    missed: Missed = Field(
        "skip", description="Reaction to missed firings: none, or one start for all of them."
    )
    busy: Busy = Field(
        "skip",
        description="While another run has the mission or its robots: skip, queue (one firing waits, "
        "until it is too late), or replace (that run is ended).",
    )
    enabled: bool = Field(True, description="`fleet schedule enable` and `disable` change it.")

    @model_validator(mode="after")
    def _one_trigger(self) -> Self:
        """Refuse no trigger, and more than one."""
        given = [name for name in TRIGGERS if getattr(self, name) is not None]
        if len(given) != 1:
            raise wrong(given[-1] if given else "mission", f"exactly one of {', '.join(TRIGGERS)} is needed")
        return self

    @model_validator(mode="after")
    def _checked_times(self) -> Self:
        """Refuse an invalid time zone, cron expression or date."""
        checks = (
            ("timezone", lambda: self.timezone is None or zone_of(self.timezone)),
            ("cron", lambda: self.cron is None or cron_fields(self.cron)),
            ("once", lambda: self.once is None or unix_time_of(self.once, self.timezone or "UTC")),
        )
        for key, check in checks:
            try:
                check()
            except ValueError as error:
                raise wrong(key, str(error)) from None
        if self.timezone is None and (self.cron is not None or (self.once and not _has_zone(self.once))):
            raise wrong("cron" if self.cron else "once", "needs a timezone:, as in Europe/Zurich, or UTC")
        return self

    @property
    def trigger(self) -> Trigger | None:
        """Return the time trigger; None for a schedule that waits for an event."""
        if self.on_event is not None:
            return None
        return Trigger(self.cron or "", self.every or 0.0, self.once or "", self.timezone or "UTC")

    def digest(self) -> str:
        """Return a text that is equal for schedules with the same firings and the same mission."""
        return self.model_dump_json(exclude={"late", "missed", "busy"})


def _has_zone(text: str) -> bool:
    """Return True if a date with time has an offset: then it is the same instant in every zone."""
    return unix_time_of(text, "UTC") == unix_time_of(text, "Asia/Tokyo")


def due_of(config: Mapping[str, ScheduleConfig], kind: EventKind, robot: str) -> list[str]:
    """Return the schedules that an event of a robot fires."""
    return [
        name
        for name, one in config.items()
        if one.on_event is not None
        and one.on_event.kind is kind
        and (not one.on_event.robots or robot in one.on_event.robots)
    ]
