"""Requests of consoles at a running edge: the edge checks permissions and names itself."""

import asyncio
import json
import time

import pytest

from fleet.bus import keys
from fleet.history.event_filter import EventFilter
from fleet.history.reader import read

HERE = {"worker": "main"}
PATROL = {"version": 1, "roles": {"eye": {"from": "rex"}}, "steps": [{"id": "go", "do": {"eye": "walk"}}]}
NEEDS_OPERATE = "it needs the permission operate; yours is view"


@pytest.fixture
async def asked_as(yard, run_edge, asks):
    """Run an edge with one robot and a console's bus session; gives what asks, and the edge."""
    place = yard(rex=HERE)
    place.change(missions={"patrol": PATROL}, schedules={"dawn": {"mission": "patrol", "every": 3600.0}})
    edge = place.edge()
    edge.bus.consoles = frozenset({"desk"})
    edge.process._endpoints._consoles._proven = edge.bus.consoles

    async with run_edge(edge):
        await asks.until(lambda: all(state.health == "ok" for state in edge.states()))
        bus_session = await asyncio.to_thread(place.bus_session)

        async def asked_as(permission, key, message, console="desk", before=b"", **parameters):
            stamped = (
                before + json.dumps({"session_id": "anna", "timestamp": time.time(), **message}).encode()
            )
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
        ("anna", True),
        ("anna", False),
        ("anna", False),
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
