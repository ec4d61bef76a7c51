"""Who asked what of a robot, and how it ended, walked from the bus into the store and out again."""

import asyncio
import json
import time
from types import SimpleNamespace

import msgspec
import pytest

from fleet.bus import keys
from fleet.history.event_filter import EventFilter
from fleet.history.reader import read
from fleet.history.record import Record
from fleet.host.requests.history_recorder import REFUSALS, ROW_ENDS, WINDOW, HistoryRecorder
from fleet.host.requests.receipt import Receipt
from fleet.host.requests.stop_cause import StopCause, cause_in, local_cause, parameters_of
from fleet.model.command import Origin, Transport
from fleet.model.event import EventKind, Requester
from fleet.model.navigation import Control
from fleet.spool.state_folder import state_folder
from fleet.testing.clock import ManualClock

HERE = {"worker": "main"}
COMMAND, OUTCOME, STOP, RELEASE = EventKind.COMMAND, EventKind.OUTCOME, EventKind.STOP, EventKind.RELEASE


@pytest.fixture
def written():
    """Return a recorder, its clock, and what it wrote."""
    events, clock = [], ManualClock()
    return SimpleNamespace(recorder=HistoryRecorder(events.append, clock), clock=clock, events=events)


def kinds(events):
    return [event.kind for event in events]


def requested(written, request):
    """Ask; returns the ticket, whose answers follow."""
    receipt = Receipt(request.name, lambda _reply: None)
    written.recorder.requested(request, receipt)
    return receipt


def test_a_command_is_written_with_its_asker_and_how_it_ended(written, requests):
    receipt = requested(written, requests.command("takeoff", data={"altitude": 5}, id="r1"))
    assert written.events == []
    receipt.accept()
    receipt.done()
    command, outcome = written.events
    assert kinds(written.events) == [COMMAND, OUTCOME]
    assert command.asker == Requester(Transport.CLOUD, "anna", "tele", proven=False)
    assert (command.command, command.request, command.data) == ("takeoff", "r1", {"altitude": 5})
    assert (outcome.text, outcome.request) == ("takeoff done", "r1")


def test_a_refused_command_is_written_once_with_the_reason(written, requests):
    requested(written, requests.command("takeoff", id="r1")).reject("no GPS")
    (event,) = written.events
    assert (event.kind, event.text, event.severity) == (COMMAND, "takeoff rejected: no GPS", "warning")


def test_a_command_that_fails_later_is_written_with_the_robots_words(written, requests):
    receipt = requested(written, requests.command("takeoff", id="r1"))
    receipt.accept()
    written.clock.advance(10)
    receipt.reject("motor 2 does not turn")
    assert [event.text for event in written.events] == [
        "takeoff accepted",
        "takeoff failed: motor 2 does not turn",
    ]


@pytest.mark.parametrize("name", ["stop", "hover", "brake"])
def test_a_stop_is_written_before_it_is_answered(written, requests, name):
    receipt = requested(written, requests.command(name))
    assert kinds(written.events) == [STOP]
    receipt.done()
    assert [event.text for event in written.events] == [f"{name} asked", f"{name} done"]


def test_the_stop_of_a_task_is_a_stop(written, requests):
    request = msgspec.structs.replace(requests.goal(), instruction=Control.STOP)
    requested(written, request)
    assert (kinds(written.events), written.events[0].request) == ([STOP], "a1")


def test_a_goal_is_written_with_its_place_and_its_action(written, requests):
    requested(written, requests.goal()).accept()
    (event,) = written.events
    assert (event.kind, event.request) == (COMMAND, "a1")
    assert msgspec.json.encode(event.data)


def test_a_release_is_one(written, requests):
    requested(written, requests.command("release_emergency_stop")).done()
    assert kinds(written.events) == [RELEASE, OUTCOME]
    requested(written, requests.command("release_emergency_stop")).reject("stop input pendant is silent")
    assert kinds(written.events)[2:] == [COMMAND]


def test_a_row_of_velocities_is_written_once_and_again_for_another_driver(written, requests):
    for session in ("anna", "anna", "ben", "ben", "anna"):
        requested(written, requests.setpoint(session=session)).done()
    assert [event.asker.name for event in written.events] == ["anna", "ben", "anna"]
    written.clock.advance(ROW_ENDS + 0.1)
    requested(written, requests.setpoint()).done()
    assert len(written.events) == 4


def test_the_end_of_a_row_without_a_stop_is_written(written, requests):
    requested(written, requests.setpoint()).done()
    written.recorder.lease_ran_out()
    written.recorder.lease_ran_out()
    assert kinds(written.events) == [COMMAND, OUTCOME]
    assert written.events[-1].asker.name == "anna"


def test_velocities_that_are_refused_at_50_hz_are_not_written_at_50_hz(written, requests):
    for _ in range(500):
        requested(written, requests.setpoint()).reject("emergency stop is set")
        written.clock.advance(0.02)
    assert 1 <= len(written.events) <= 3


def test_a_flood_of_refusals_is_counted_and_the_number_reported(written, requests):
    for number in range(1000):
        requested(written, requests.command("takeoff", id=f"r{number}")).reject("no")
    assert len(written.events) == REFUSALS
    written.clock.advance(WINDOW + 1)
    requested(written, requests.command("takeoff", id="later")).reject("no")
    assert written.events[-1].data["untold"] == 1000 - REFUSALS


def test_a_flood_of_refusals_hides_no_stop(written, requests):
    for number in range(1000):
        requested(written, requests.command("takeoff", id=f"r{number}")).reject("no")
    requested(written, requests.command("stop"))
    written.recorder.stopped(local_cause("anna"))
    assert kinds(written.events)[-2:] == [STOP, STOP]


def test_a_repeat_is_written_as_one(written, requests):
    for _ in range(2):
        receipt = requested(written, requests.command("land", id="r1"))
        receipt.accept()
        receipt.done()
    assert [event.text for event in written.events][2:] == [
        "land asked again: the first answer was given again"
    ]


def test_one_stop_that_comes_by_two_ways_is_written_once_and_proven_once_that_is_known(written):
    claimed, proven = cause_in(parameters_of("anna", "fire", "s1")), local_cause("anna", "fire", "s1")
    for cause in (claimed, claimed, proven, proven, claimed):
        written.recorder.stopped(cause)
    assert [event.asker.proven for event in written.events] == [False, True]


def test_what_a_stop_says_of_itself_survives_the_bus_whatever_it_is():
    for text in ("fire; why=no&by=me?", "Überlauf größer", "a=b;c", " ", "x" * 1000, "\x1b[31m"):
        cause = cause_in(parameters_of("anna", text, "s1"))
        assert cause.asker == Requester(Transport.BUS, "anna")
        assert cause.reason in (text, text[:200], "\\x1b[31m")
    for broken in ({}, {"by": "zz"}, {"why": "\udce9"}, {"by": ""}):
        assert isinstance(cause_in(broken), StopCause)


def test_a_message_that_cannot_be_read_is_written(written):
    receipt = Receipt("takeoff", lambda _reply: None)
    written.recorder.unread("command", Origin(Transport.BUS), receipt)
    receipt.reject("data: an object is needed")
    assert [event.text for event in written.events] == ["takeoff rejected: data: an object is needed"]


# -- the edge ----------------------------------------------------------------------------------------


@pytest.fixture
async def served(yard, run_edge, requests):
    """Run an edge with a robot in its process and one in a worker, and a session to ask on."""
    place = yard(rex=HERE, max={})
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        bus_session = await asyncio.to_thread(place.bus_session)
        yield SimpleNamespace(place=place, edge=edge, bus_session=bus_session)
        await asyncio.to_thread(bus_session.close)


async def request(served, robot, message, **parameters):
    """Ask a robot on its bus key; returns when it has answered."""
    payload = json.dumps({"session_id": "anna@desk", "timestamp": time.time(), **message}).encode()
    key = keys.command(served.place.id, robot)

    def answers():
        return list(served.bus_session.request(key, payload, timeout=60, parameters=parameters))

    return await asyncio.to_thread(answers)


async def history(served, **wanted):
    """Ask the edge for its history."""
    key, payload = keys.history(served.place.id), msgspec.json.encode(EventFilter(**wanted))
    answers = await asyncio.to_thread(lambda: list(served.bus_session.request(key, payload, timeout=60)))
    return [record for _, part in answers for record in msgspec.json.decode(part, type=list[Record])]


async def wait_for_event(served, robot, kind, requests):
    """Wait until an event of a robot is in the history; returns it."""
    found = []
    async with asyncio.timeout(60):
        while not found:
            found = [each for each in await history(served, robots=(robot,)) if each.kind is kind]
    return found[-1]


async def test_what_was_asked_on_the_bus_is_in_the_edges_history_also_for_a_worker(served, requests):
    for robot in ("rex", "max"):
        await request(served, robot, {"command": "move_forward", "data": {"linear_x": 1.0}})
        event = await wait_for_event(served, robot, COMMAND, requests)
        assert event.asker == Requester(Transport.BUS, "anna@desk", None, proven=False)
        ended = await wait_for_event(served, robot, OUTCOME, requests)
        assert ended.text == "no velocity within its lease: stopped"
    for robot in ("rex", "max"):
        await is_stopped_with_who_and_why(served, robot, requests)


async def is_stopped_with_who_and_why(served, robot, requests):
    """Stop a robot on the stop key; release it."""
    said = parameters_of("anna@desk", f"fire at {robot}", f"s-{robot}")
    key, names = keys.stop("*"), json.dumps([robot]).encode()
    await asyncio.to_thread(
        lambda: list(served.bus_session.request(key, names, timeout=60, parameters=said, urgent=True))
    )
    event = await wait_for_event(served, robot, STOP, requests)
    assert (event.asker.name, event.data, event.request) == (
        "anna@desk",
        {"reason": f"fire at {robot}"},
        f"s-{robot}",
    )
    state = next(each for each in served.edge.robots() if each.name == robot).state
    await requests.until(lambda: f"fire at {robot}" in state().stop_cause)
    async with asyncio.timeout(60):
        while state().emergency_stop:  # one that comes too soon after the stop is refused
            await request(served, robot, {"command": "release_emergency_stop"})
            await asyncio.sleep(0.1)
    assert (await wait_for_event(served, robot, RELEASE, requests)).asker.name == "anna@desk"


async def test_the_history_survives_the_edge_and_its_health_tells_a_folder_that_is_gone(
    yard, run_edge, requests
):
    place = yard(rex=HERE)
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        served = SimpleNamespace(
            place=place, edge=edge, bus_session=await asyncio.to_thread(place.bus_session)
        )
        await request(served, "rex", {"command": "emergency_stop"})
        await asyncio.to_thread(served.bus_session.close)
    folder = state_folder(place.id)
    assert STOP in [record.kind for record in read(folder, EventFilter(("rex",)))]
