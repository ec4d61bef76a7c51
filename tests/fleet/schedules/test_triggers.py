"""When schedules fire: a year in three zones, exactly; and the traps of APScheduler, each closed."""

import itertools
from datetime import UTC, date, datetime, timedelta
from zoneinfo import ZoneInfo

import pytest
from apscheduler.triggers.cron import CronTrigger
from hypothesis import given
from hypothesis import strategies as st

from fleet.schedules.triggers import Trigger, cron_fields, firings, instant_of, unix_time_of, zone_of

BEGIN = datetime(2026, 1, 1, tzinfo=UTC).timestamp()
END = datetime(2027, 1, 1, tzinfo=UTC).timestamp()


def fired(trigger, begin=BEGIN, end=END):
    return list(itertools.takewhile(lambda at: at < end, firings(trigger, begin)))


def utc(text):
    return datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()


def days(first, last):
    return [first + timedelta(days=number) for number in range((last - first).days + 1)]


def daily(hour, minute, offsets, first=date(2025, 12, 31), last=date(2027, 1, 1)):
    """Return the instants of a time of day, by the offset (hours) that holds from each instant on."""
    found = []
    for day in days(first, last):
        wall = datetime(day.year, day.month, day.day, hour, minute, tzinfo=UTC)
        for since, until, offset in offsets:
            at = wall.timestamp() - offset * 3600
            if since <= at < until:
                found.append(at)
    return [at for at in found if BEGIN < at < END]


def test_a_year_in_zurich_fires_every_day_once_though_one_night_has_no_such_time_and_one_has_two():
    spring, autumn = utc("2026-03-29T01:00"), utc("2026-10-25T01:00")
    expected = daily(2, 30, [(0, spring, 1), (spring, autumn, 2), (autumn, END, 1)])
    expected.remove(utc("2026-10-25T01:30"))  # the second 02:30 of that night
    expected.append(spring)  # the gap's end, for the 02:30 that is not
    got = fired(Trigger(cron="30 2 * * *", zone="Europe/Zurich"))
    assert got == sorted(expected)
    assert len(got) == 365


def test_a_year_in_new_york_on_weekdays():
    spring, autumn = utc("2026-03-08T07:00"), utc("2026-11-01T06:00")
    expected = daily(6, 0, [(0, spring, -5), (spring, autumn, -4), (autumn, END + 86400, -5)])
    expected = [at for at in expected if datetime.fromtimestamp(at, UTC).weekday() < 5]
    got = fired(Trigger(cron="0 6 * * mon-fri", zone="America/New_York"))
    assert got == expected
    assert len(got) == 261


def test_a_year_on_lord_howe_whose_clocks_move_by_half_an_hour():
    spring, autumn = utc("2026-10-03T15:30"), utc("2026-04-04T15:00")
    expected = daily(2, 15, [(0, autumn, 11), (autumn, spring, 10.5), (spring, END, 11)])
    expected.append(spring)
    assert fired(Trigger(cron="15 2 * * *", zone="Australia/Lord_Howe")) == sorted(expected)
    overlapped = daily(1, 45, [(0, autumn, 11), (autumn, spring, 10.5), (spring, END, 11)])
    overlapped.remove(utc("2026-04-04T15:15"))
    assert fired(Trigger(cron="45 1 * * *", zone="Australia/Lord_Howe")) == overlapped


# -- the traps: each begins with what APScheduler does by itself


def test_weekdays_are_names_for_by_number_they_are_other_days():
    found = CronTrigger.from_crontab("0 9 * * 1", UTC).get_next_fire_time(
        None, datetime(2026, 1, 1, tzinfo=UTC)
    )
    assert found.strftime("%a") == "Tue"  # every cron says Monday
    for number in ("1", "0", "7", "1-5", "mon-5", "*/2", "mon#1"):
        with pytest.raises(ValueError, match="is no weekday"):
            cron_fields(f"0 9 * * {number}")
    (monday, *_) = fired(Trigger(cron="0 9 * * mon", zone="UTC"))
    assert datetime.fromtimestamp(monday, UTC).strftime("%a") == "Mon"


def test_a_time_that_comes_twice_fires_once():
    zone = ZoneInfo("Europe/Zurich")
    raw, at = [], datetime(2026, 10, 24, 12, tzinfo=zone)
    for _ in range(2):
        at = CronTrigger.from_crontab("30 2 * * *", zone).get_next_fire_time(None, at + timedelta(seconds=1))
        raw.append(at.timestamp())
        at = datetime.fromtimestamp(at.timestamp(), UTC)
    assert raw[1] - raw[0] == 3600  # twice in one night
    got = fired(
        Trigger(cron="30 2 * * *", zone="Europe/Zurich"), utc("2026-10-24T12:00"), utc("2026-10-25T12:00")
    )
    assert got == [utc("2026-10-25T00:30")]


def test_a_time_that_is_left_out_fires_at_the_end_of_the_gap_and_several_of_them_once():
    zone = "Europe/Zurich"
    night = utc("2026-03-28T23:30"), utc("2026-03-29T02:30")
    assert fired(Trigger(cron="30 2 * * *", zone=zone), *night) == [utc("2026-03-29T01:00")]
    assert fired(Trigger(cron="*/10 2 * * *", zone=zone), *night) == [utc("2026-03-29T01:00")]
    every_half = fired(Trigger(cron="*/30 * * * *", zone=zone), *night)
    assert [(at - every_half[0]) / 60 for at in every_half] == [0, 30, 60, 90, 120]


def test_a_day_of_the_month_and_a_weekday_are_not_taken_together():
    """Cron would take either of the two, APScheduler takes both."""
    raw = CronTrigger.from_crontab("0 0 13 * fri", UTC)
    assert raw.get_next_fire_time(None, datetime(2026, 1, 1, tzinfo=UTC)).strftime("%a %d") == "Fri 13"
    with pytest.raises(ValueError, match="a day of the month and a weekday"):
        cron_fields("0 0 13 * fri")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0 6 * *", "needs five fields"),
        ("0 6 * * * *", "needs five fields"),
        ("", "needs five fields"),
        ("60 6 * * *", "60"),
        ("x 6 * * *", "x"),
        ("0 6 * 13 *", "13"),
        ("0 0 30 2 *", "never fires"),
        ("0 0 * * fri-mon", "minimum"),
    ],
)
def test_an_expression_that_is_none_is_refused(text, expected):
    with pytest.raises(ValueError, match=expected):
        cron_fields(text)


def test_the_29th_of_february_is_found_years_ahead():
    (first, *_) = fired(
        Trigger(cron="0 0 29 2 *", zone="UTC"), utc("2096-03-01T00:00"), utc("2105-01-01T00:00")
    )
    assert first == utc("2104-02-29T00:00")


def test_every_is_counted_from_one_instant_whatever_the_clocks_do():
    got = fired(Trigger(every=900.0), utc("2026-03-29T00:50"), utc("2026-03-29T01:40"))
    assert got == [utc(f"2026-03-29T01:{minute:02}") for minute in (0, 15, 30)]


@pytest.mark.parametrize(
    ("text", "zone", "at"),
    [
        ("2026-07-01T06:00", "Europe/Zurich", "2026-07-01T04:00"),
        ("2026-07-01T06:00Z", "Europe/Zurich", "2026-07-01T06:00"),
        ("2026-03-29T02:30", "Europe/Zurich", "2026-03-29T01:00"),
        ("2026-10-25T02:30", "Europe/Zurich", "2026-10-25T00:30"),
    ],
)
def test_once_is_in_its_zone_unless_it_names_one(text, zone, at):
    assert unix_time_of(text, zone) == utc(at)
    trigger = Trigger(once=text, zone=zone)
    assert fired(trigger) == [utc(at)]
    assert fired(trigger, utc(at)) == []


def test_a_zone_that_does_not_exist_is_reported():
    for name in ("Europe/Zuerich", "", "../etc/passwd", "/etc/passwd"):
        with pytest.raises(ValueError, match="there is no time zone"):
            zone_of(name)


@given(
    st.sampled_from(["Europe/Zurich", "America/New_York", "Australia/Lord_Howe", "Pacific/Apia", "UTC"]),
    st.datetimes(datetime(2011, 12, 1), datetime(2030, 1, 1)),  # noqa: DTZ001 - on a clock on a wall
)
def test_every_wall_clock_time_has_one_instant_which_shows_it_unless_it_is_left_out(name, wall):
    zone, wall = ZoneInfo(name), wall.replace(second=0, microsecond=0)
    at = instant_of(wall, zone)
    shown = datetime.fromtimestamp(at, zone).replace(tzinfo=None, fold=0)
    assert shown >= wall
    if shown != wall:  # the instant before, clocks show less than what was asked for
        assert datetime.fromtimestamp(at - 1, zone).replace(tzinfo=None) < wall


@given(st.sampled_from(["30 2 * * *", "*/20 * * * *", "0 0 1 * *"]), st.integers(int(BEGIN), int(END)))
def test_firings_do_not_depend_on_when_one_begins_to_look(cron, after):
    trigger = Trigger(cron=cron, zone="Europe/Zurich")
    begun = list(itertools.islice(firings(trigger, after), 3))
    assert begun == sorted(set(begun))
    assert begun[0] > after
    assert next(firings(trigger, begun[0])) == begun[1]
    earlier = itertools.islice(firings(trigger, after - 7200), 50)
    assert next(at for at in earlier if at > after) == begun[0]
