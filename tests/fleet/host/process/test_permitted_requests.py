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
async def asked_as(yard, run_edge, asks):
    """Run an edge with one robot and a console's bus session; gives what asks, and the edge."""
    place = yard(rex=HERE)
    place.change(missions={"patrol": PATROL}, schedules={"dawn": {"mission": "patrol", "every": 3600.0}})
    edge = place.edge()
    edge.process.senders._consoles = frozenset({"desk"})
    edge.process.senders._people = {"anna": Permission.OPERATE, "vic": Permission.VIEW}

    async with run_edge(edge):
        await asks.until(lambda: all(state.health == "ok" for state in edge.states()))
        bus_session = await asyncio.to_thread(place.bus_session)

        async def asked_as(permission, key, message, console="desk", before=b"", **parameters):
            stamped = before + json.dumps({"session_id": "eve", "timestamp": time.time(), **message}).encode()
            asked = keys.as_console(key, permission, console)
            found = await asyncio.to_thread(
                lambda: list(bus_session.ask(asked, stamped, timeout=20, parameters=parameters))
            )
            return json.loads(found[0][1])

        asked_as.edge, asked_as.place = edge, place
        asked_as.robot = keys.command(place.id, "rex")
        yield asked_as
        await asyncio.to_thread(bus_session.close)


def command(name):
    return {"command": name, "data": {}}


async def test_a_robot_obeys_a_console_as_far_as_its_persons_permission_goes(asked_as):
    refused = await asked_as("view", asked_as.robot, command("walk"), kind="command")
    assert (refused["status"], refused["reason"]) == ("rejected", NEEDS_OPERATE)
    refused = await asked_as("operate", asked_as.robot, command("restart_adapter"), kind="command")
    assert refused["reason"] == "it needs the permission admin; yours is operate"
    refused = await asked_as("view", asked_as.robot, {"linear_x": 0.1}, kind="motion")
    assert refused["reason"] == NEEDS_OPERATE
    assert asked_as.place.words("rex") == ["run"]
    taken = await asked_as("operate", asked_as.robot, command("walk"), kind="command")
    assert taken["status"] == "accepted"


async def test_a_message_that_only_the_cloud_may_send_so_needs_the_permission_too(asked_as):
    tele = {"linear_x": 0.1, "source_type": "tele"}
    refused = await asked_as("view", asked_as.robot, tele, before=b" ", kind="motion", way="cloud")
    assert (refused["status"], refused["reason"]) == ("rejected", NEEDS_OPERATE)
    assert asked_as.place.words("rex") == ["run"]


async def test_what_cannot_be_read_is_refused_to_who_may_only_look(asked_as):
    refused = await asked_as("view", asked_as.robot, {"linear_x": 0.1}, before=b" ", kind="motion")
    assert (refused["status"], "JSON" in refused["reason"]) == ("rejected", True)


async def test_a_stop_needs_no_permission(asked_as):
    for stop in ("stop", "emergency_stop"):
        taken = await asked_as("view", asked_as.robot, command(stop), kind="command")
        assert taken["status"] == "accepted"
    refused = await asked_as("view", asked_as.robot, command("release_emergency_stop"), kind="command")
    assert refused["reason"] == NEEDS_OPERATE


@pytest.mark.parametrize("word", ["root", "*", "OPERATE"])
async def test_a_permission_that_there_is_not_moves_nothing(asked_as, word):
    refused = await asked_as(word, asked_as.robot, command("walk"), kind="command")
    assert (refused["status"], "names no permission" in refused["reason"]) == ("rejected", True)
    assert asked_as.place.words("rex") == ["run"]


async def test_the_name_is_believed_only_of_a_console_with_a_certificate(asked_as, asks):
    for console in ("desk", keys.LOCAL, "other"):
        await asked_as("operate", asked_as.robot, command("walk"), kind="command", console=console)
    history = asked_as.edge.process.history

    def askers():
        found = [*read(history.folder, EventFilter(("rex",), 0.0, 50)), *history.waiting()]
        return [each.asker for each in found if (each.kind, each.command) == ("command", "walk")]

    await asks.until(lambda: len(askers()) == 3)
    assert [(asker.name, asker.proven) for asker in askers()] == [
        ("eve", True),
        ("eve", False),
        ("eve", False),
    ]


async def test_missions_and_schedules_ask_for_the_permission_too(asked_as):
    edge = asked_as.place.id
    mission, schedules = keys.mission(edge, "patrol"), keys.schedules(edge)
    assert (await asked_as("view", mission, {}, do="start"))["refusal"] == NEEDS_OPERATE
    sent = await asked_as("operate", mission, {"mission": PATROL}, do="start")
    assert sent["refusal"] == "it needs the permission admin; yours is operate"
    assert (await asked_as("view", keys.run(edge, "3f2a"), {"do": "abort"}))["refusal"] == NEEDS_OPERATE
    assert (await asked_as("view", schedules, {"do": "run", "name": "dawn"}))["refusal"] == NEEDS_OPERATE
    listed = await asked_as("view", schedules, {"do": "list"})
    assert [each["name"] for each in listed["schedules"]] == ["dawn"]
    started = await asked_as("operate", mission, {}, do="start")
    assert started["run"]


def proven_history(asked_as):
    """Return what the history has of who asked, with a proof."""
    history = asked_as.edge.process.history
    found = [*read(history.folder, EventFilter((), 0.0, 90)), *history.waiting()]
    return [(each.robot, each.text, each.asker.name) for each in found if each.asker and each.asker.proven]


async def test_a_person_with_a_certificate_is_named_by_it_whatever_the_message_says(asked_as, asks):
    taken = await asked_as("person", asked_as.robot, command("walk"), kind="command", console="anna")
    assert taken["status"] == "accepted"
    await asks.until(lambda: ("rex", "walk accepted", "anna") in proven_history(asked_as))


async def test_who_may_only_view_is_refused_with_words_and_that_is_recorded(asked_as, asks):
    refused = await asked_as("person", asked_as.robot, command("walk"), kind="command", console="vic")
    assert (refused["status"], refused["reason"]) == ("rejected", NEEDS_OPERATE)
    drives = await asked_as("person", asked_as.robot, {"linear_x": 0.1}, kind="motion", console="vic")
    assert drives["reason"] == NEEDS_OPERATE
    assert asked_as.place.words("rex") == ["run"]
    await asks.until(lambda: ("rex", f"walk refused: {NEEDS_OPERATE}", "vic") in proven_history(asked_as))


async def test_everybody_may_stop_and_the_stop_has_the_proven_name(asked_as, asks):
    for stop in ("stop", "emergency_stop"):
        taken = await asked_as("person", asked_as.robot, command(stop), kind="command", console="vic")
        assert taken["status"] == "accepted"
    await asks.until(lambda: ("rex", "emergency_stop asked", "vic") in proven_history(asked_as))
    released = await asked_as("person", asked_as.robot, command("release_emergency_stop"), console="vic")
    assert released["reason"] == NEEDS_OPERATE


async def test_a_person_whom_the_edge_does_not_know_may_stop_and_nothing_else(asked_as):
    refused = await asked_as("person", asked_as.robot, command("walk"), kind="command", console="mallory")
    assert "has no permission for mallory" in refused["reason"]
    taken = await asked_as("person", asked_as.robot, command("stop"), kind="command", console="mallory")
    assert taken["status"] == "accepted"


async def test_missions_runs_and_schedules_know_the_person_too(asked_as, asks):
    edge = asked_as.place.id
    mission, schedules = keys.mission(edge, "patrol"), keys.schedules(edge)
    assert (await asked_as("person", mission, {}, console="vic", do="start"))["refusal"] == NEEDS_OPERATE
    aborts = await asked_as("person", keys.run(edge, "3f2a"), {"do": "abort"}, console="vic")
    assert aborts["refusal"] == NEEDS_OPERATE
    runs = await asked_as("person", schedules, {"do": "run", "name": "dawn"}, console="vic")
    assert runs["refusal"] == NEEDS_OPERATE
    texts = ("mission patrol: start", "run 3f2a: abort", "schedule dawn: run")
    expected = {("", f"{text} refused: {NEEDS_OPERATE}", "vic") for text in texts}
    await asks.until(lambda: expected <= set(proven_history(asked_as)))
    started = await asked_as("person", mission, {"run": "r1"}, console="anna", do="start")
    assert started["run"] == "r1"
    await asks.until(lambda: ("", "mission patrol started: eye rex", "anna") in proven_history(asked_as))


async def test_a_common_start_is_prepared_only_for_who_may_operate(asked_as, asks):
    prepare = keys.prepare(asked_as.place.id, "rex")
    refused = await asked_as("person", prepare, command("walk"), console="vic", kind="command", start="s1")
    assert (refused["status"], refused["reason"]) == ("rejected", NEEDS_OPERATE)
    without = await asked_as("person", prepare, command("walk"), console="anna", kind="command", start="s1")
    assert "is not present" in without["reason"]
    stopped = await asked_as("person", prepare, command("stop"), console="vic", kind="command", start="s1")
    assert stopped["status"] == "accepted"
