"""A schedule of fleet.yaml: one trigger, valid times, and which events fire it."""

import pytest
from pydantic import ValidationError

from fleet.model.event import EventKind
from fleet.schedules.model import EventTrigger, ScheduleConfig, due_of
from fleet.schedules.triggers import Trigger

CRON, ZONE = "0 6 * * mon-fri", "Europe/Zurich"
FOUND = {"kind": EventKind.BATTERY}


def schedule(**given):
    return ScheduleConfig(mission="patrol", **given)


def refused(**given):
    """Return the key that an error is reported at, and the error."""
    with pytest.raises(ValidationError) as caught:
        schedule(**given)
    (error,) = caught.value.errors()
    return error["ctx"]["key"], error["ctx"]["reason"]


@pytest.mark.parametrize(
    ("given", "trigger"),
    [
        ({"cron": CRON, "timezone": ZONE}, Trigger(cron=CRON, zone=ZONE)),
        ({"every": "15 min"}, Trigger(every=900.0)),
        ({"every": 10}, Trigger(every=10.0)),
        ({"once": "2026-11-22T06:00", "timezone": ZONE}, Trigger(once="2026-11-22T06:00", zone=ZONE)),
        ({"once": "2026-11-22T06:00+01:00"}, Trigger(once="2026-11-22T06:00+01:00")),
        ({"once": "2026-11-22T06:00Z"}, Trigger(once="2026-11-22T06:00Z")),
        ({"on_event": FOUND}, None),
    ],
)
def test_a_schedule_has_one_trigger(given, trigger):
    assert schedule(**given).trigger == trigger


@pytest.mark.parametrize(
    ("given", "key"),
    [
        ({}, "mission"),
        ({"timezone": ZONE}, "mission"),
        ({"cron": CRON, "every": 60, "timezone": ZONE}, "every"),
        ({"every": 60, "once": "2026-11-22T06:00Z"}, "once"),
        ({"every": 60, "on_event": FOUND}, "on_event"),
    ],
)
def test_no_trigger_and_more_than_one_are_refused_at_the_last(given, key):
    assert refused(**given) == (key, "exactly one of cron, every, once, on_event is needed")


@pytest.mark.parametrize(
    ("given", "key", "reason"),
    [
        (
            {"every": 60, "timezone": "Europe/Zürich"},
            "timezone",
            "there is no time zone 'Europe/Zürich' here",
        ),
        ({"every": 60, "timezone": "../etc/passwd"}, "timezone", "there is no time zone"),
        ({"cron": "0 6 * *", "timezone": ZONE}, "cron", "needs five fields"),
        ({"cron": "", "timezone": ZONE}, "cron", "needs five fields"),
        ({"cron": "0 6 31 2 *", "timezone": ZONE}, "cron", "never fires"),
        ({"once": "tomorrow", "timezone": ZONE}, "once", "'tomorrow' is no date with time"),
        ({"cron": CRON}, "cron", "needs a timezone:, as in Europe/Zurich, or UTC"),
        ({"once": "2026-11-22T06:00"}, "once", "needs a timezone:, as in Europe/Zurich, or UTC"),
        ({"once": "2026-11-22"}, "once", "needs a timezone:, as in Europe/Zurich, or UTC"),
    ],
)
def test_a_time_that_is_none_is_refused_at_its_key(given, key, reason):
    found, said = refused(**given)
    assert found == key
    assert said.startswith(reason)


@pytest.mark.parametrize(
    "given",
    [
        {"every": 9.9},
        {"every": "9 s"},
        {"every": 0},
        {"late": 0},
        {"missed": "all"},
        {"busy": "wait"},
        {"more": 1},
    ],
)
def test_bounds_and_words_are_checked(given):
    with pytest.raises(ValidationError):
        schedule(**{"every": 60, **given})


def test_a_schedule_that_says_no_more_starts_late_by_ten_minutes_and_skips_the_rest():
    one = schedule(every=60)
    assert (one.late, one.missed, one.busy, one.enabled, one.inputs) == (600.0, "skip", "skip", True, {})


def test_the_digest_tells_schedules_apart_by_what_fires_and_what_is_started():
    one = schedule(every=60)
    assert one.digest() == schedule(every="1 min").digest()
    for more in ({"late": 5}, {"missed": "once"}, {"busy": "queue"}):
        assert schedule(every=60, **more).digest() == one.digest()
    for other in (
        schedule(every=61),
        schedule(every=60, inputs={"a": 1}),
        schedule(every=60, timezone=ZONE),
        schedule(every=60, enabled=False),
        ScheduleConfig(mission="night", every=60),
    ):
        assert other.digest() != one.digest()


def test_an_event_fires_the_schedules_that_wait_for_its_kind_and_robot():
    config = {
        "any": schedule(on_event=FOUND),
        "rex": schedule(on_event=EventTrigger(kind=EventKind.BATTERY, robots=("rex", "kes"))),
        "max": schedule(on_event=EventTrigger(kind=EventKind.BATTERY, robots=("max",))),
        "lost": schedule(on_event=EventTrigger(kind=EventKind.LOST)),
        "time": schedule(every=60),
    }
    assert due_of(config, EventKind.BATTERY, "rex") == ["any", "rex"]
    assert due_of(config, EventKind.BATTERY, "") == ["any"]
    assert due_of(config, EventKind.LOST, "max") == ["lost"]
    assert due_of(config, EventKind.STOP, "rex") == []
