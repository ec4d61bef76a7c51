"""When a schedule fires: pure arithmetic on Unix seconds, without a clock.

A cron expression is read as wall-clock times, by APScheduler's ``CronTrigger`` in a zone without shifts; each
wall-clock time is then put on the time line by rules of our own: one that comes twice (clocks go back) fires
the first time, one that never comes (clocks go forward) fires at the end of the gap, and several that fall
together fire once. APScheduler's scheduler, executors and stores are not used.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import msgspec

FIELDS = ("minute", "hour", "day", "month", "day_of_week")
WEEKDAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
AHEAD = timedelta(days=9 * 366)
"""What is searched for the next firing: 29 February may be eight years away."""
WIDEST = timedelta(hours=25)
"""More than any zone was ever put forward or back; so far back wall-clock times are looked at again."""
_WEEKDAY = re.compile(rf"(\*|(?:{'|'.join(WEEKDAYS)})(?:-(?:{'|'.join(WEEKDAYS)}))?)")


class Trigger(msgspec.Struct, frozen=True):
    """Exactly one of ``cron``, ``every`` (s) and ``once`` (ISO date with time), in a zone by its name."""

    cron: str = ""
    every: float = 0.0
    once: str = ""
    zone: str = "UTC"


def zone_of(name: str) -> ZoneInfo:
    """Return a time zone; raises ValueError for one that does not exist."""
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise ValueError(f"there is no time zone {name!r} here; as in Europe/Zurich, or UTC") from None


def cron_fields(text: str) -> dict[str, str]:
    """Return the five fields of a cron expression; raises ValueError saying what is wrong with it.

    Weekdays are names: by number they mean another day in every program. Day of the month and weekday exclude
    each other: cron takes either, APScheduler both.
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


def once_at(text: str, zone: str) -> float:
    """Return the Unix seconds of a date with time, in a zone unless it names one; raises ValueError."""
    try:
        found = datetime.fromisoformat(text)
    except ValueError:
        raise ValueError(f"{text!r} is no date with time, as in 2026-11-22T06:00") from None
    return found.timestamp() if found.tzinfo is not None else instant_of(found, zone_of(zone))


def firings(trigger: Trigger, after: float) -> Iterator[float]:
    """Yield when a trigger fires after an instant, in order, without end unless it ends; Unix seconds."""
    if trigger.every:
        turn = math.floor(after / trigger.every) + 1
        while True:
            yield turn * trigger.every
            turn += 1
    if trigger.once:
        at = once_at(trigger.once, trigger.zone)
        if at > after:
            yield at
        return
    zone = zone_of(trigger.zone)
    last = after
    now, before = (datetime.fromtimestamp(at, zone) for at in (after, after - WIDEST.total_seconds()))
    shifted = now.utcoffset() != before.utcoffset()  # then some times of the day come twice, or never
    begin = now.replace(tzinfo=None, fold=0) - WIDEST * shifted
    for wall in _walls(cron_fields(trigger.cron), begin):
        at = instant_of(wall, zone)
        if at > last:
            yield at
            last = at


def instant_of(wall: datetime, zone: ZoneInfo) -> float:
    """Return when a wall-clock time is: the first of two, or the end of the gap that it is in."""
    first = wall.replace(tzinfo=zone, fold=0)
    at = first.timestamp()
    if datetime.fromtimestamp(at, zone).replace(tzinfo=None) == wall:
        return at
    # In a gap the first reading takes the offset from before it, the second that from after: the gap's end
    # lies between the two.
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
    """Yield the wall-clock times of a cron expression from one on; raises ValueError for a bad field."""
    from apscheduler.triggers.cron import CronTrigger  # noqa: PLC0415 - 0.14 s, for who has a cron alone

    trigger = CronTrigger(**fields, timezone=UTC)
    at = begin.replace(tzinfo=UTC)
    while True:
        trigger.end_date = at + AHEAD
        found: datetime | None = trigger.get_next_fire_time(None, at)
        if found is None:
            return
        yield found.replace(tzinfo=None)
        at = found + timedelta(seconds=1)
