"""Firing times of schedules: pure arithmetic on Unix seconds, without a clock.

APScheduler's ``CronTrigger`` computes the wall-clock times of a cron expression in a zone without shifts.
Rules of our own map them to instants: a time that occurs twice (clocks go back) fires the first time, a
skipped time (clocks go forward) fires at the end of the gap, and times that coincide fire once. APScheduler's
scheduler, executors and stores are not used.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import msgspec

FIELDS = ("minute", "hour", "day", "month", "day_of_week")
WEEKDAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
AHEAD = timedelta(days=9 * 366)
"""Range of the search for the next firing: 29 February may be eight years away."""
WIDEST = timedelta(hours=25)
"""More than any shift of a zone; after a shift, wall-clock times this far back are checked again."""
_WEEKDAY = re.compile(rf"(\*|(?:{'|'.join(WEEKDAYS)})(?:-(?:{'|'.join(WEEKDAYS)}))?)")


class Trigger(msgspec.Struct, frozen=True):
    """Exactly one of ``cron``, ``every`` (s) and ``once`` (ISO date with time), in a named zone."""

    cron: str = ""
    every: float = 0.0
    once: str = ""
    zone: str = "UTC"


def zone_of(name: str) -> ZoneInfo:
    """Return a time zone; raises ValueError for an unknown one."""
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise ValueError(f"there is no time zone {name!r} here; as in Europe/Zurich, or UTC") from None


@functools.lru_cache(256)
def cron_fields(text: str) -> Mapping[str, str]:
    """Return the five fields of a cron expression; raises ValueError with the error.

    Weekdays must be names, because their numbers differ between programs. Day of the month and weekday
    exclude each other: cron combines them with or, APScheduler with and.
    """
    parts = text.lower().split()
    if len(parts) != len(FIELDS):
        raise ValueError("needs five fields: minute hour day month weekday, as in 0 6 * * mon-fri")
    fields = dict(zip(FIELDS, parts, strict=True))
    for day in fields["day_of_week"].split(","):
        if not _WEEKDAY.fullmatch(day):
            raise ValueError(f"{day!r} is no weekday: mon, tue, wed, thu, fri, sat, sun, or a range of them")
    if fields["day"] != "*" and fields["day_of_week"] != "*":
        raise ValueError("says a day of the month and a weekday; leave one of the two *")
    if next(_walls(fields, datetime(2026, 1, 1)), None) is None:  # noqa: DTZ001 - wall-clock times have no zone
        raise ValueError("never fires: there is no such day")
    return fields


def unix_time_of(text: str, zone: str) -> float:
    """Return the Unix seconds of a date with time, in ``zone`` unless it has an offset; raises ValueError."""
    try:
        found = datetime.fromisoformat(text)
    except ValueError:
        raise ValueError(f"{text!r} is no date with time, as in 2026-11-22T06:00") from None
    return found.timestamp() if found.tzinfo is not None else instant_of(found, zone_of(zone))


def firings(trigger: Trigger, after: float) -> Iterator[float]:
    """Yield the firings of a trigger after an instant, in order and possibly endless; Unix seconds."""
    if trigger.every:
        turn = math.floor(after / trigger.every) + 1
        while True:
            yield turn * trigger.every
            turn += 1
    if trigger.once:
        at = unix_time_of(trigger.once, trigger.zone)
        if at > after:
            yield at
        return
    zone = zone_of(trigger.zone)
    last = after
    now, before = (datetime.fromtimestamp(at, zone) for at in (after, after - WIDEST.total_seconds()))
    shifted = now.utcoffset() != before.utcoffset()  # then some times of day occur twice or never
    begin = now.replace(tzinfo=None, fold=0) - WIDEST * shifted
    for wall in _walls(cron_fields(trigger.cron), begin):
        at = instant_of(wall, zone)
        if at > last:
            yield at
            last = at


def instant_of(wall: datetime, zone: ZoneInfo) -> float:
    """Return the instant of a wall-clock time: the first of two, or the end of the gap that skips it."""
    first = wall.replace(tzinfo=zone, fold=0)
    at = first.timestamp()
    if datetime.fromtimestamp(at, zone).replace(tzinfo=None) == wall:
        return at
    # In a gap, fold=0 takes the offset before it and fold=1 the offset after it: the end of the gap lies
    # between the two instants.
    low, high = wall.replace(tzinfo=zone, fold=1).timestamp(), at
    before = datetime.fromtimestamp(low, zone).utcoffset()
    while high - low > 0.5:
        middle = (low + high) / 2
        if datetime.fromtimestamp(middle, zone).utcoffset() == before:
            low = middle
        else:
            high = middle
    return float(round(high))


def _walls(fields: Mapping[str, str], begin: datetime) -> Iterator[datetime]:
    """Yield the wall-clock times of a cron expression from ``begin``; raises ValueError for a bad field."""
    from apscheduler.triggers.cron import CronTrigger  # noqa: PLC0415 - 0.14 s, only for cron

    trigger = CronTrigger(**fields, timezone=UTC)
    at = begin.replace(tzinfo=UTC)
    while True:
        trigger.end_date = at + AHEAD
        found: datetime | None = trigger.get_next_fire_time(None, at)
        if found is None:
            return
        yield found.replace(tzinfo=None)
        at = found + timedelta(seconds=1)
