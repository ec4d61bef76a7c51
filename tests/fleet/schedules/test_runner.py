"""Schedules in simulated time: what is started, skipped and told, and what a crash leaves behind."""

import asyncio
import itertools
from datetime import UTC, datetime

import pytest

from fleet.errors import StateError
from fleet.model.event import EventKind, EventReport
from fleet.model.schedule import Firing
from fleet.schedules.model import ScheduleConfig
from fleet.schedules.runner import Schedules, StartResult
from fleet.schedules.store import DUE, SKIPPED, STARTED, FiringStore
from fleet.schedules.triggers import Trigger, firings
from fleet.testing.clock import ManualClock

START = datetime(2026, 1, 1, tzinfo=UTC).timestamp()


class Runs:
    """What starts missions: it remembers keys, and answers as the test says."""

    def __init__(self):
        self.wanted = []
        self.keys = {}
        self.answer = None
        self.raises = None

    async def start(self, wanted):
        self.wanted.append(wanted)
        if self.answer is not None:
            return self.answer
        self.keys.setdefault(wanted.key, f"run-{len(self.keys)}")
        if self.raises is not None:
            raise self.raises
        return StartResult(self.keys[wanted.key])

    async def known(self, key):
        return self.keys.get(key, "")


class Yard:
    """Schedules with a clock that tests turn."""

    def __init__(self, folder):
        self.folder, self.clock, self.runs = folder, ManualClock(time=START), Runs()
        self.events, self.stopped = [], {}
        self.configs = {}
        self.schedules = None

    async def serve(self, *, after_takeover=False, **configs):
        """Begin a process with these schedules."""
        self.configs = {name: ScheduleConfig(mission="patrol", **each) for name, each in configs.items()}
        self.store = FiringStore(self.folder)
        self.schedules = Schedules(
            self.configs,
            self.store,
            self.runs,
            clock=self.clock,
            tell=self.events.append,
            stopped=lambda: self.stopped,
        )
        await self.schedules.begin(after_takeover=after_takeover)
        return self.schedules

    async def after(self, seconds):
        self.clock.advance(seconds)
        await self.schedules.poll()

    def texts(self):
        return [event.text for event in self.events]

    def states(self, name="dawn"):
        return [(one.due - START, one.state) for one in reversed(self.store.last(name, 100))]


@pytest.fixture
def yard(tmp_path):
    return Yard(tmp_path)


async def test_a_year_in_three_zones_starts_exactly_what_is_due(yard):
    """Every firing of a year, through both shifts of the clocks of each zone, and none besides."""
    configs = {
        "zurich": {"cron": "30 2 * * *", "timezone": "Europe/Zurich"},
        "york": {"cron": "0 6 * * mon-fri", "timezone": "America/New_York"},
        "howe": {"cron": "15 2 * * *", "timezone": "Australia/Lord_Howe"},
    }
    schedules = await yard.serve(**configs)
    end = datetime(2027, 1, 1, tzinfo=UTC).timestamp()
    expected = {}
    for name, config in configs.items():
        trigger = Trigger(cron=config["cron"], zone=config["timezone"])
        expected[name] = list(itertools.takewhile(lambda at: at < end, firings(trigger, START)))
    for ahead in sorted({at for times in expected.values() for at in times}):
        yard.clock.advance(ahead - yard.clock.time() + 0.4)
        await schedules.poll()
    for name, times in expected.items():
        started = [wanted.key for wanted in yard.runs.wanted if wanted.schedule == name]
        assert started == [f"{name}@{at:.3f}" for at in times]
    assert len(yard.runs.wanted) == 365 + 261 + 365
    assert not any("skipped" in text for text in yard.texts())


async def test_a_schedule_that_is_new_makes_up_for_nothing(yard):
    await yard.serve(dawn={"every": "1 h", "missed": "once"})
    await yard.after(10.0)
    assert yard.runs.wanted == []
    await yard.after(3600.0)
    assert [wanted.key for wanted in yard.runs.wanted] == [f"dawn@{START + 3600:.3f}"]
    assert yard.texts() == ["schedule dawn: started as run-0"]


async def test_what_was_missed_while_nothing_ran_is_reported_and_skipped(yard):
    await yard.serve(dawn={"every": "1 h", "late": "5 min"})
    await yard.after(3601.0)
    yard.store.close()
    yard.clock.advance(3 * 3600 + 1800)
    await yard.serve(dawn={"every": "1 h", "late": "5 min"})
    await yard.after(1.0)
    assert len(yard.runs.wanted) == 1
    assert "skipped: 3 firings came due" in yard.texts()[-1]


async def test_one_start_makes_up_for_all_that_was_missed(yard):
    config = {"every": "1 h", "late": "5 min", "missed": "once"}
    await yard.serve(dawn=config)
    await yard.after(3601.0)
    yard.store.close()
    yard.clock.advance(3 * 3600 + 1800)
    await yard.serve(dawn=config)
    await yard.after(1.0)
    await yard.after(1.0)
    assert len(yard.runs.wanted) == 2
    assert yard.states()[-1] == (4 * 3600.0, STARTED)


@pytest.mark.parametrize(
    ("busy", "started", "expected"),
    [("skip", 0, "run-9 is in its way"), ("queue", 1, ""), ("replace", 0, "")],
)
async def test_what_is_busy_is_skipped_waited_for_or_replaced(yard, busy, started, expected):
    await yard.serve(dawn={"every": "1 h", "busy": busy})
    yard.runs.answer = StartResult(busy="run-9")
    await yard.after(3600.0)
    yard.runs.answer = None
    await yard.after(60.0)
    assert [text for text in yard.texts() if "started" in text] == [
        "schedule dawn: started as run-0"
    ] * started
    assert yard.runs.wanted[0].replace is (busy == "replace")
    assert expected in " ".join(yard.texts())


async def test_one_that_waits_gives_way_to_a_later_one(yard):
    await yard.serve(dawn={"every": "10 min", "busy": "queue", "late": "15 min"})
    yard.runs.answer = StartResult(busy="run-9")
    await yard.after(600.0)
    await yard.after(600.0)
    assert yard.states() == [(600.0, SKIPPED), (1200.0, DUE)]


async def test_one_that_waits_is_skipped_when_it_is_too_late(yard):
    await yard.serve(dawn={"every": "40 min", "busy": "queue", "late": "15 min"})
    yard.runs.answer = StartResult(busy="run-9")
    await yard.after(2400.0)
    await yard.after(1000.0)
    assert yard.states() == [(2400.0, SKIPPED)]
    assert "it was due 1000 s ago" in yard.texts()[-1]


async def test_one_that_waits_is_skipped_when_its_schedule_is_switched_off_or_changed(yard):
    waits = {"every": "10 min", "busy": "queue"}
    schedules = await yard.serve(off=waits, other=waits)
    yard.runs.answer = StartResult(busy="run-9")
    await yard.after(600.0)
    await schedules.enable("off", enabled=False, by="anna")
    new = {
        "off": ScheduleConfig(mission="patrol", **waits),
        "other": ScheduleConfig(mission="night", **waits),
    }
    await schedules.replace(new)
    texts = yard.texts()
    assert "schedule off: skipped: disabled by anna" in texts
    assert "schedule other: skipped: the schedule has changed" in texts
    yard.runs.answer = None
    await yard.after(60.0)
    assert [wanted.mission for wanted in yard.runs.wanted] == ["patrol", "patrol"], "both were busy then"


async def test_what_another_edge_has_fired_meanwhile_is_not_made_up_for(yard):
    once = {"every": "1 h", "missed": "once"}
    await yard.serve(dawn=once)
    yard.store.record("dawn", [Firing("dawn", START + 3600.0, recorded=START + 3600.0)], START + 3600.0)
    yard.store.close()
    yard.clock.advance(5 * 3600.0 + 60.0)
    await yard.serve(after_takeover=True, dawn=once)
    await yard.after(10.0)
    assert yard.runs.wanted == []
    assert "schedule dawn: skipped: another edge had the robots" in yard.texts()
    await yard.after(3600.0)
    assert len(yard.runs.wanted) == 1


async def test_robots_whose_emergency_stop_is_set_are_named_and_left_out_and_that_is_reported(yard):
    await yard.serve(dawn={"every": "1 h"})
    yard.stopped = {"rex": "its emergency stop is set: anna"}
    yard.runs.answer = StartResult("run-1", left_out=yard.stopped)
    await yard.after(3600.0)
    assert yard.runs.wanted[0].without == yard.stopped
    assert "rex left out: its emergency stop is set: anna" in yard.texts()[-1]


async def test_a_refusal_is_reported_and_kept(yard):
    await yard.serve(dawn={"every": "1 h"})
    yard.runs.answer = StartResult(refusal="nobody can be eye")
    await yard.after(3600.0)
    await yard.after(1.0)
    assert len(yard.runs.wanted) == 1
    (firing,) = yard.store.last("dawn")
    assert (firing.state, firing.reason) == (SKIPPED, "nobody can be eye")
    assert yard.texts() == ["schedule dawn: skipped: nobody can be eye"]


async def test_a_start_that_fails_on_the_way_is_known_by_its_key(yard):
    await yard.serve(dawn={"every": "1 h"})
    yard.runs.raises = RuntimeError("boom")
    await yard.after(3600.0)
    assert yard.states() == [(3600.0, STARTED)]
    yard.runs.answer = StartResult("")
    yard.runs.raises = None
    await yard.after(3600.0)
    assert yard.states()[-1] == (7200.0, SKIPPED)


async def test_what_a_dead_process_left_open_is_asked_for_by_its_key(yard):
    await yard.serve(dawn={"every": "1 h"}, dusk={"every": "1 h"}, noon={"every": "1 h"})
    for name in ("dawn", "dusk", "noon"):
        yard.store.record(name, [Firing(name, START + 3600.0, recorded=START + 3600.0)], START + 3600.0)
    yard.store.close()
    yard.clock.advance(3601.0)
    yard.runs.keys[f"dawn@{START + 3600:.3f}"] = "run-7"  # it was started; the answer was lost
    await yard.serve(dawn={"every": "1 h"}, dusk={"every": "1 h"})
    await yard.after(0.5)
    assert [wanted.key for wanted in yard.runs.wanted] == [f"dusk@{START + 3600:.3f}"]
    assert [yard.states(name) for name in ("dawn", "dusk", "noon")] == [
        [(3600.0, STARTED)],
        [(3600.0, STARTED)],
        [(3600.0, SKIPPED)],
    ]
    assert any("the schedule is gone" in text for text in yard.texts())


async def test_what_cannot_be_recorded_is_not_started_and_reported(yard, monkeypatch):
    await yard.serve(dawn={"every": "1 h"})

    def full(*_):
        raise StateError("the disk is full")

    monkeypatch.setattr(FiringStore, "record", full)
    await yard.after(3600.0)
    assert yard.runs.wanted == []
    assert yard.texts() == ["schedule dawn: skipped: it cannot be recorded: the disk is full"]
    assert yard.schedules.problem == "the disk is full"


async def test_a_clock_that_is_set_back_fires_nothing_again(yard):
    await yard.serve(dawn={"every": "1 h"})
    await yard.after(3600.0)
    yard.clock.step(-600.0)
    await yard.after(700.0)
    assert len(yard.runs.wanted) == 1


async def test_a_schedule_that_is_switched_off_stays_off_through_a_restart_and_makes_up_for_nothing(yard):
    config = {"every": "1 h", "missed": "once"}
    schedules = await yard.serve(dawn=config)
    await schedules.enable("dawn", enabled=False, by="anna")
    await yard.after(7200.0)
    yard.store.close()
    schedules = await yard.serve(dawn=config)
    await yard.after(7200.0)
    (state,) = await schedules.states()
    assert (state.enabled, state.next, yard.runs.wanted) == (False, None, [])
    await schedules.enable("dawn", enabled=True, by="anna")
    await yard.after(1800.0)
    assert yard.runs.wanted == []
    await yard.after(1800.0)
    assert len(yard.runs.wanted) == 1
    assert yard.texts()[:2] == ["schedule dawn: disabled by anna", "schedule dawn: enabled by anna"]


async def test_a_schedule_that_is_changed_makes_up_for_nothing(yard):
    await yard.serve(dawn={"every": "1 h", "missed": "once"})
    await yard.after(3601.0)
    yard.store.close()
    yard.clock.advance(86400.0)
    await yard.serve(dawn={"every": "2 h", "missed": "once"})
    await yard.after(10.0)
    assert len(yard.runs.wanted) == 1


async def test_schedules_that_are_replaced_go_on_as_if_they_had_always_been_there(yard):
    schedules = await yard.serve(kept={"every": 3600.0}, changed={"every": 60.0}, gone={"every": 3600.0})
    yard.runs.answer = StartResult(busy="run x")
    await yard.after(30.0)
    new = {"kept": {"every": 3600.0}, "changed": {"every": 20.0}, "new": {"every": 3600.0}}
    await schedules.replace({name: ScheduleConfig(mission="patrol", **each) for name, each in new.items()})
    assert [state.name for state in await schedules.states()] == ["changed", "kept", "new"]
    yard.runs.answer = None
    await yard.after(20.0)
    assert [wanted.schedule for wanted in yard.runs.wanted] == ["changed"]
    await yard.after(3550.0)
    assert sorted(wanted.schedule for wanted in yard.runs.wanted) == ["changed", "changed", "kept", "new"]


async def test_what_waits_of_a_schedule_that_is_gone_is_skipped_and_reported(yard):
    schedules = await yard.serve(low={"every": 60.0, "busy": "queue"})
    yard.runs.answer = StartResult(busy="run x")
    await yard.after(60.0)
    await schedules.replace({})
    assert "schedule low: skipped: the schedule is gone" in yard.texts()
    await yard.after(60.0)
    assert len(yard.runs.wanted) == 1


async def test_an_event_fires_what_waits_for_it_once(yard):
    waits = {"on_event": {"kind": "battery", "robots": ["rex"]}}
    schedules = await yard.serve(low=waits)
    event = EventReport(START + 1.0, EventKind.BATTERY, "18 %")
    yard.clock.advance(1.5)
    for robot in ("max", "rex", "rex"):
        await schedules.handle_event(robot, event)
    await schedules.handle_event("rex", EventReport(START + 2.0, EventKind.FOUND, "ok"))
    assert [wanted.key for wanted in yard.runs.wanted] == [f"low@{START + 1:.3f}"]
    assert "fired: rex: 18 %" in yard.texts()[0]


async def test_a_schedule_is_started_by_hand_though_it_is_off(yard):
    schedules = await yard.serve(dawn={"every": "1 h", "enabled": False})
    firing = await schedules.start_now("dawn", by="anna")
    assert (firing.state, firing.run) == (STARTED, "run-0")


async def test_schedules_do_not_wait_for_one_that_hangs_for_ever(yard, monkeypatch):
    monkeypatch.setattr("fleet.schedules.runner.START_WITHIN", 0.05)
    await yard.serve(dawn={"every": "1 h"}, dusk={"every": "1 h"})

    async def start(wanted):
        yard.runs.wanted.append(wanted)
        if wanted.schedule == "dawn":
            await asyncio.Event().wait()
        return StartResult("run-1")

    yard.runs.start = start
    await yard.after(3600.0)
    assert yard.states("dusk") == [(3600.0, STARTED)]
    assert yard.states("dawn") == [(3600.0, SKIPPED)]
