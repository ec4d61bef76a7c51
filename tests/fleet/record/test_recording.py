"""Recording an edge from its bus: its reports, states and history, once each."""

import asyncio
import time

import msgspec
import pytest

from fleet.bus import keys
from fleet.clock import SystemClock
from fleet.history.record import Record
from fleet.model.description import RobotDescription
from fleet.model.event import EventKind
from fleet.model.report import BatteryReport
from fleet.model.schedule import ScheduleAnswer
from fleet.record.recording import record
from fleet.record.task import Bounds, RecordTask
from fleet.wire.databus import encode_report
from tests.tools.waiting import DEADLINE

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"


@pytest.fixture
def yard(play_edge):
    return play_edge("yard-1", robots={"rex": {"twin": TWIN}})


def publish(yard):
    """Let the robot report, and its edge tell that it is stopped."""
    yard.bus.reports.put(f"cw/{TWIN}/data/battery", encode_report(BatteryReport(time.time(), 50.0), 1))
    yard.bus.control.put("fleet/*/stop", b"[]", urgent=True)


@pytest.fixture
def recorded(runtime, yard, tmp_path, read_back):
    """Record until wanted topics were read back and ``also`` holds; return the messages and their number."""

    async def recorded(wanted, also=lambda: True):
        task = RecordTask(str(tmp_path / "recordings"), Bounds(free=0))
        ended, problems = asyncio.Event(), []
        running = asyncio.create_task(record(task, runtime, ended, SystemClock(), on_problem=problems.append))
        async with asyncio.timeout(DEADLINE):
            while not (wanted <= {topic for topic, _, _ in read_back(tmp_path / "recordings")} and also()):
                publish(yard)
                await asyncio.wait([running], timeout=0.1)
            ended.set()
            count = await running
        assert problems == [""]
        return read_back(tmp_path / "recordings"), count

    return recorded


async def test_an_edge_is_recorded_with_its_history(yard, recorded):
    yard.tells(keys.history("yard-1"), [Record(time.time() + 1, "rex", EventKind.STOP, "stopped")])
    found, count = await recorded(
        {"/yard-1/rex/battery", "/yard-1/rex/state", "/yard-1/health", "/yard-1/stop", "/yard-1/rex/history"}
    )
    (event,) = [each.data for topic, _, each in found if topic == "/yard-1/rex/history"]
    assert (count, msgspec.json.decode(event, type=Record).text) == (len(found), "stopped")


async def test_fences_and_schedules_of_an_edge_are_asked_for(yard, recorded):
    yard.tells(keys.description("yard-1", "rex"), RobotDescription("rex", "toy", ()))
    yard.tells(keys.schedules("yard-1"), ScheduleAnswer())
    await recorded({"/yard-1/rex/description"})


async def test_an_edge_that_cannot_tell_its_history_is_recorded_all_the_same(yard, recorded, caplog):
    yard.tells(keys.history("yard-1"), {"no": "list"})
    await recorded({"/yard-1/rex/battery"}, lambda: "the history of yard-1 cannot be read" in caplog.text)
