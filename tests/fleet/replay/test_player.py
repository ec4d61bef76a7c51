"""A recording on a bus of its own: seen by who looks there, heard by no robot, at any speed."""

import asyncio
import time

import msgspec
import pytest

from fleet.bus import keys
from fleet.bus.bus import join, open_edge
from fleet.bus.settings import BusSettings, running_edges
from fleet.clock import SystemClock
from fleet.errors import StateError
from fleet.history.event_filter import EventFilter
from fleet.history.record import Record
from fleet.model.command import Reply
from fleet.model.event import EventKind
from fleet.model.report import BatteryReport
from fleet.model.state import EdgeState, RobotState
from fleet.record.file import RecordingFile
from fleet.record.messages import Message, report_messages
from fleet.record.samples import event_message
from fleet.replay.player import PlayedWindow, play, replay_directory
from fleet.runtime.decoding import decode_json
from fleet.wire.databus import decode_report, encode_report
from tests.tools.waiting import DEADLINE

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
T = 1_800_000_000.0


def message(topic, value):
    return Message(topic, f"fleet.{type(value).__name__}", msgspec.json.encode(value), T)


@pytest.fixture
def recording(tmp_path):
    """Write five seconds of a robot: a state, an event, a stop, and a charge that falls each second."""
    file = RecordingFile(tmp_path / "walk.mcap")
    at = round(T * 1e9)
    file.add(message("/yard/rex/state", RobotState("rex", TWIN, "ugv", "yard", T, "ok")), at)
    file.add(message("/yard/health", EdgeState("yard", "1", T, 5.0)), at)
    file.add(event_message("yard", Record(T, "rex", EventKind.STOP, "stopped")), at)
    file.add(Message("/yard/stop", "fleet.Document", b'{"value": []}'), at)
    for second in range(5):
        sample = encode_report(BatteryReport(T + second, 50.0 - second), 1)
        for each in report_messages("/yard/rex", "battery", sample):
            file.add(each, at + second * 1_000_000_000)
    file.close()
    return tmp_path / "walk.mcap"


@pytest.fixture
def played(recording, directory):
    """Play it, and call something with a session on its bus when that is there."""

    async def played(window, *, look=lambda _bus: None, until=None):
        ended, results = asyncio.Event(), []

        def on_edge(edge):
            bus = join(BusSettings(edge.name), directory)
            results.append((bus, look(bus)))

        async with asyncio.timeout(DEADLINE):
            count = await play(recording, window, directory, ended, SystemClock(), on_edge=on_edge)
            found = until and await asyncio.to_thread(until, results[0][0])
        for bus, _ in results:
            bus.close()
        return count, found

    return played


async def test_its_reports_are_put_in_their_order_and_time_with_a_stamp_of_now(played):
    heard = []

    def look(bus):
        bus.reports.subscribe(f"cw/{TWIN}/data/battery", lambda _key, data: heard.append(data))

    began = time.time()
    await played(PlayedWindow(speed=5.0), look=look)
    reports = [decode_report("battery", each) for each in heard]
    percents = [report.percent for report in reports]
    assert percents == sorted(percents, reverse=True)
    assert percents[-1] == 46.0
    assert all(report.stamp >= began for report in reports)
    assert time.time() - began >= 0.8


async def test_a_window_begins_with_what_was_so_before(played):
    count, _ = await played(PlayedWindow(start=3.0, length=1.5, speed=10.0))
    assert count == 7  # state, health, stop, charge and event before it, and two charges in it


@pytest.fixture
def playing(recording, directory):
    """Play it slowly, and look at it meanwhile; returns what was found."""

    async def playing(look):
        ended, there = asyncio.Event(), asyncio.Event()
        running = asyncio.create_task(
            play(
                recording,
                PlayedWindow(speed=0.01),
                directory,
                ended,
                SystemClock(),
                on_edge=lambda _edge: there.set(),
            )
        )
        async with asyncio.timeout(DEADLINE):
            await there.wait()
            bus = await asyncio.to_thread(join, BusSettings("replay-yard"), directory)
            try:
                return await asyncio.to_thread(look, bus.control)
            finally:
                await asyncio.to_thread(bus.close)
                ended.set()
                await running

    return playing


def requested(control, key, kind, payload=b""):
    """Ask until there is an answer."""
    end = time.monotonic() + DEADLINE
    while time.monotonic() < end:
        for _, data in control.request(key, payload, timeout=1.0):
            return decode_json(data, kind)
    raise AssertionError(f"no answer on {key}")


async def test_its_robots_are_shown_as_simulated_ones_of_an_edge_of_another_name(playing):
    state = await playing(lambda control: requested(control, keys.state("*", "*"), RobotState))
    assert (state.edge, state.name, state.simulated, state.health) == ("replay-yard", "rex", True, "ok")


async def test_its_events_are_reported(playing):
    payload = msgspec.json.encode(EventFilter())

    def look(control):
        while not (found := requested(control, keys.history("replay-yard"), list[Record], payload)):
            pass
        return found

    assert [record.text for record in await playing(look)] == ["stopped"]


async def test_what_is_asked_of_its_robots_is_refused(playing):
    reply = await playing(lambda control: requested(control, keys.command("replay-yard", "rex"), Reply))
    assert (reply.status, "nothing here moves" in reply.reason) == ("rejected", True)


async def test_no_other_edge_hears_of_it_not_even_of_its_stops(playing, directory, opened, tmp_path):
    heard = []
    other = tmp_path / "others"
    other.mkdir(mode=0o700)
    yard = opened(open_edge(BusSettings("yard"), directory))
    for lane in (yard.reports, yard.control):
        lane.subscribe("**", lambda key, _data: heard.append(key))
    await playing(lambda control: requested(control, keys.health("*"), EdgeState))
    assert heard == []


def test_the_folder_of_its_sockets_is_one_where_nobody_looks_for_edges(directory, monkeypatch):
    monkeypatch.setenv("FLEET_RUNTIME_DIR", str(directory))
    place = replay_directory()
    with_one = open_edge(BusSettings("replay-yard"), place)
    try:
        assert (running_edges(place), running_edges(directory)) == (["replay-yard"], [])
    finally:
        with_one.close()


async def test_a_window_with_nothing_in_it_is_reported(played):
    with pytest.raises(StateError, match="nothing in that window"):
        await played(PlayedWindow(start=100.0))
