"""Requests of consoles and of persons at a running edge: the edge checks permissions and names itself."""

import asyncio
import json
import time

import pytest

from fleet.bus import keys
from fleet.history.event_filter import EventFilter
from fleet.history.reader import read
from fleet.model.permission import Permission

HERE = {"worker": "main"}
PATROL = {"version": 1, "roles": {"eye": {"from": "rex"}}, "steps": [{"id": "go", "do": {"eye": "walk"}}]}
NEEDS_OPERATE = "it needs the permission operate; yours is view"


@pytest.fixture
async def requested_as(yard, run_edge, requests):
    """Run an edge with one robot and a console's bus session; gives what asks, and the edge."""
    place = yard(rex=HERE)
    place.change(missions={"patrol": PATROL}, schedules={"dawn": {"mission": "patrol", "every": 3600.0}})
    edge = place.edge()
    edge.process.senders._consoles = frozenset({"desk"})
    edge.process.senders._people = {"anna": Permission.OPERATE, "vic": Permission.VIEW}

    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        bus_session = await asyncio.to_thread(place.bus_session)

        async def requested_as(permission, key, message, console="desk", before=b"", **parameters):
            stamped = before + json.dumps({"session_id": "eve", "timestamp": time.time(), **message}).encode()
            requested = keys.as_console(key, permission, console)
            found = await asyncio.to_thread(
                lambda: list(bus_session.request(requested, stamped, timeout=20, parameters=parameters))
            )
            return json.loads(found[0][1])

        requested_as.edge, requested_as.place = edge, place
        requested_as.robot = keys.command(place.id, "rex")
        yield requested_as
        await asyncio.to_thread(bus_session.close)


def command(name):
    return {"command": name, "data": {}}


async def test_a_robot_obeys_a_console_as_far_as_its_persons_permission_goes(requested_as):
    refused = await requested_as("view", requested_as.robot, command("walk"), kind="command")
    assert (refused["status"], refused["reason"]) == ("rejected", NEEDS_OPERATE)
    refused = await requested_as("operate", requested_as.robot, command("restart_adapter"), kind="command")
    assert refused["reason"] == "it needs the permission admin; yours is operate"
    refused = await requested_as("view", requested_as.robot, {"linear_x": 0.1}, kind="motion")
    assert refused["reason"] == NEEDS_OPERATE
    assert requested_as.place.words("rex") == ["run"]
    taken = await requested_as("operate", requested_as.robot, command("walk"), kind="command")
    assert taken["status"] == "accepted"


async def test_a_message_that_only_the_cloud_may_send_so_needs_the_permission_too(requested_as):
    tele = {"linear_x": 0.1, "source_type": "tele"}
    refused = await requested_as("view", requested_as.robot, tele, before=b" ", kind="motion", way="cloud")
    assert (refused["status"], refused["reason"]) == ("rejected", NEEDS_OPERATE)
    assert requested_as.place.words("rex") == ["run"]


async def test_what_cannot_be_read_is_refused_to_who_may_only_look(requested_as):
    refused = await requested_as("view", requested_as.robot, {"linear_x": 0.1}, before=b" ", kind="motion")
    assert (refused["status"], "JSON" in refused["reason"]) == ("rejected", True)


async def test_a_stop_needs_no_permission(requested_as):
    for stop in ("stop", "emergency_stop"):
        taken = await requested_as("view", requested_as.robot, command(stop), kind="command")
        assert taken["status"] == "accepted"
    refused = await requested_as(
        "view", requested_as.robot, command("release_emergency_stop"), kind="command"
    )
    assert refused["reason"] == NEEDS_OPERATE


@pytest.mark.parametrize("word", ["root", "*", "OPERATE"])
async def test_a_permission_that_there_is_not_moves_nothing(requested_as, word):
    refused = await requested_as(word, requested_as.robot, command("walk"), kind="command")
    assert (refused["status"], "names no permission" in refused["reason"]) == ("rejected", True)
    assert requested_as.place.words("rex") == ["run"]


async def test_the_name_is_believed_only_of_a_console_with_a_certificate(requested_as, requests):
    for console in ("desk", keys.LOCAL, "other"):
        await requested_as("operate", requested_as.robot, command("walk"), kind="command", console=console)
    history = requested_as.edge.process.history

    def askers():
        found = [*read(history.folder, EventFilter(("rex",), 0.0, 50)), *history.waiting()]
        return [each.asker for each in found if (each.kind, each.command) == ("command", "walk")]

    await requests.until(lambda: len(askers()) == 3)
    assert [(asker.name, asker.proven) for asker in askers()] == [
        ("eve", True),
        ("eve", False),
        ("eve", False),
    ]


async def test_missions_and_schedules_ask_for_the_permission_too(requested_as):
    edge = requested_as.place.id
    mission, schedules = keys.mission(edge, "patrol"), keys.schedules(edge)
    assert (await requested_as("view", mission, {}, do="start"))["refusal"] == NEEDS_OPERATE
    sent = await requested_as("operate", mission, {"mission": PATROL}, do="start")
    assert sent["refusal"] == "it needs the permission admin; yours is operate"
    assert (await requested_as("view", keys.run(edge, "3f2a"), {"do": "abort"}))["refusal"] == NEEDS_OPERATE
    assert (await requested_as("view", schedules, {"do": "run", "name": "dawn"}))["refusal"] == NEEDS_OPERATE
    listed = await requested_as("view", schedules, {"do": "list"})
    assert [each["name"] for each in listed["schedules"]] == ["dawn"]
    started = await requested_as("operate", mission, {}, do="start")
    assert started["run"]


def proven_history(requested_as):
    """Return what the history has of who asked, with a proof."""
    history = requested_as.edge.process.history
    found = [*read(history.folder, EventFilter((), 0.0, 90)), *history.waiting()]
    return [(each.robot, each.text, each.asker.name) for each in found if each.asker and each.asker.proven]


async def test_a_person_with_a_certificate_is_named_by_it_whatever_the_message_says(requested_as, requests):
    taken = await requested_as("person", requested_as.robot, command("walk"), kind="command", console="anna")
    assert taken["status"] == "accepted"
    await requests.until(lambda: ("rex", "walk accepted", "anna") in proven_history(requested_as))


async def test_who_may_only_view_is_refused_with_words_and_that_is_recorded(requested_as, requests):
    refused = await requested_as("person", requested_as.robot, command("walk"), kind="command", console="vic")
    assert (refused["status"], refused["reason"]) == ("rejected", NEEDS_OPERATE)
    drives = await requested_as("person", requested_as.robot, {"linear_x": 0.1}, kind="motion", console="vic")
    assert drives["reason"] == NEEDS_OPERATE
    assert requested_as.place.words("rex") == ["run"]
    await requests.until(
        lambda: ("rex", f"walk refused: {NEEDS_OPERATE}", "vic") in proven_history(requested_as)
    )


async def test_everybody_may_stop_and_the_stop_has_the_proven_name(requested_as, requests):
    for stop in ("stop", "emergency_stop"):
        taken = await requested_as("person", requested_as.robot, command(stop), kind="command", console="vic")
        assert taken["status"] == "accepted"
    await requests.until(lambda: ("rex", "emergency_stop asked", "vic") in proven_history(requested_as))
    released = await requested_as(
        "person", requested_as.robot, command("release_emergency_stop"), console="vic"
    )
    assert released["reason"] == NEEDS_OPERATE


async def test_a_person_whom_the_edge_does_not_know_may_stop_and_nothing_else(requested_as):
    refused = await requested_as(
        "person", requested_as.robot, command("walk"), kind="command", console="mallory"
    )
    assert "has no permission for mallory" in refused["reason"]
    taken = await requested_as(
        "person", requested_as.robot, command("stop"), kind="command", console="mallory"
    )
    assert taken["status"] == "accepted"


async def test_missions_runs_and_schedules_know_the_person_too(requested_as, requests):
    edge = requested_as.place.id
    mission, schedules = keys.mission(edge, "patrol"), keys.schedules(edge)
    assert (await requested_as("person", mission, {}, console="vic", do="start"))["refusal"] == NEEDS_OPERATE
    aborts = await requested_as("person", keys.run(edge, "3f2a"), {"do": "abort"}, console="vic")
    assert aborts["refusal"] == NEEDS_OPERATE
    runs = await requested_as("person", schedules, {"do": "run", "name": "dawn"}, console="vic")
    assert runs["refusal"] == NEEDS_OPERATE
    texts = ("mission patrol: start", "run 3f2a: abort", "schedule dawn: run")
    expected = {("", f"{text} refused: {NEEDS_OPERATE}", "vic") for text in texts}
    await requests.until(lambda: expected <= set(proven_history(requested_as)))
    started = await requested_as("person", mission, {"run": "r1"}, console="anna", do="start")
    assert started["run"] == "r1"
    await requests.until(
        lambda: ("", "mission patrol started: eye rex", "anna") in proven_history(requested_as)
    )


async def test_a_common_start_is_prepared_only_for_who_may_operate(requested_as, requests):
    prepare = keys.prepare(requested_as.place.id, "rex")
    refused = await requested_as(
        "person", prepare, command("walk"), console="vic", kind="command", start="s1"
    )
    assert (refused["status"], refused["reason"]) == ("rejected", NEEDS_OPERATE)
    without = await requested_as(
        "person", prepare, command("walk"), console="anna", kind="command", start="s1"
    )
    assert "is not present" in without["reason"]
    stopped = await requested_as(
        "person", prepare, command("stop"), console="vic", kind="command", start="s1"
    )
    assert stopped["status"] == "accepted"
