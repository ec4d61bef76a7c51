"""A stop from the console: by every way, followed until the robots stand, and honest about who did not."""

import json

import pytest

from fleet.console.stops import NO_ANSWER, NOT_SEEN, StopRecord, StopTarget
from fleet.supervisor.protocol import StopAnswer
from tests.tools.waiting import wait_until


@pytest.fixture(scope="module")
def yard(play_edge, console):
    """Play an edge whose robots are seen by the console."""
    robots = {
        "rex": {"reachable": True, "health": "ok"},
        "beast": {"reachable": True, "health": "ok"},
        "stubborn": {"last_command": "emergency_stop", "last_outcome": "error: HOLD was refused"},
    }
    yard = play_edge("yard-1", robots=robots, groups={"ground": ["rex", "beast"]})
    with console.page() as page:
        for name in robots:
            page.wait_for("robots", f"yard-1/{name}")
    return yard


def test_everything_is_stopped_and_seen_to_stand_robot_by_robot(console, yard):
    with console.page() as page:
        page.request("stop", request="all", why="a test")
        assert page.answer("all")["stop"]["everything"]
        ended = page.wait_for("stops", "all", lambda stop: not stop["open"])
    assert yard.stops[-1] == []
    rex = ended["robots"]["yard-1/rex"]
    assert (rex["outcome"], rex["way"]) == ("done", "bus")
    assert 1 <= rex["acknowledged"] <= rex["standing"]
    stubborn = ended["robots"]["yard-1/stubborn"]
    assert (stubborn["standing"], stubborn["outcome"]) == (None, "error: HOLD was refused")
    assert (ended["by"], ended["why"]) == ("anna", "a test")


def test_one_robot_is_stopped_and_no_other(console, yard):
    with console.page() as page:
        page.request("stop", request="one", robots=["yard-1/rex"])
        stop = page.answer("one")["stop"]
    assert (list(stop["robots"]), yard.stops[-1]) == (["yard-1/rex"], ["rex"])


def test_a_stop_that_comes_by_both_ways_is_one_stop(console, yard):
    before = len(yard.stops)
    with console.page() as page:
        page.request("stop", request="twice", robots=["yard-1/beast"])
        page.answer("twice")
        status, _, body = console.post(
            "/api/stop",
            {"ask": "stop", "request": "twice", "robots": ["yard-1/beast"]},
            cookie=console.cookie(),
        )
    assert (status, json.loads(body)["request"]) == (200, "twice")
    assert len(yard.stops) == before + 1


def test_a_stop_without_a_websocket_is_answered_and_followed(console, yard):
    request = {"ask": "stop", "request": "post", "robots": ["yard-1/rex"]}
    status, _, body = console.post("/api/stop", request, cookie=console.cookie())
    assert status == 200
    assert json.loads(body)["robots"]["yard-1/rex"]["acknowledged"] >= 1

    def ended():
        _, _, found = console.request("GET", "/api/stops/post", cookie=console.cookie())
        return not json.loads(found)["open"]

    wait_until("the stop to be over", ended)


def test_a_robot_that_nobody_has_did_not_answer(console, yard):
    with console.page() as page:
        page.request("stop", request="nobody", robots=["yard-1/ghost"])
        ended = page.wait_for("stops", "nobody", lambda stop: not stop["open"])
    assert ended["robots"]["yard-1/ghost"]["outcome"] == NO_ANSWER


def test_a_stop_works_with_no_edge_at_all_and_says_that_it_reached_nobody(runtime, serve_console):
    with serve_console(runtime, "alone", only=True) as alone, alone.page() as page:
        page.request("stop", request="all")
        answer = page.answer("all")
        assert (answer["status"], answer["stop"]["robots"]) == ("accepted", {})


def test_the_supervisors_are_asked_at_the_same_time(console, yard, monkeypatch):
    def stop_all(directory, names, *, why, request):
        assert (names, request) == (("rover",), "away")
        return [StopAnswer(1, "far-1", ("rover",)), StopAnswer(2, "gone-1", ("mule",), kept=True)]

    monkeypatch.setattr("fleet.console.stops.stop_all", stop_all)
    with console.page() as page:
        page.request("stop", request="away", robots=["far-1/rover"])
        stop = page.answer("away")["stop"]
    assert stop["robots"]["far-1/rover"]["way"] == "supervisor"
    assert stop["problems"][0].startswith("edge gone-1 is away: mule was halted")


def test_a_way_that_fails_keeps_no_other_way_from_stopping(console, yard, monkeypatch):
    monkeypatch.setattr("fleet.console.stops.stop_all", lambda *_, **__: 1 / 0)
    with console.page() as page:
        page.request("stop", request="broken", robots=["yard-1/rex"])
        stop = page.answer("broken")["stop"]
    assert stop["robots"]["yard-1/rex"]["acknowledged"] >= 1
    assert stop["problems"] == ["supervisors: division by zero"]


def test_who_was_not_seen_to_stand_is_reported_at_the_end():
    record = StopRecord("anna", "", StopTarget(), ["a/rex", "a/beast"], 10.0)
    record.acknowledge("a/rex", 10.004, "bus")
    record.acknowledge("a/rex", 10.2, "supervisor")
    assert record.pending() == ["a/rex"]
    record.observe("a/rex", "under way", 10.5)
    record.close()
    rex, beast = record.shown()["robots"].values()
    assert (rex["acknowledged"], rex["way"], rex["outcome"]) == (4, "bus", NOT_SEEN)
    assert (beast["acknowledged"], beast["outcome"]) == (None, NO_ANSWER)


def test_names_are_asked_of_their_own_edge():
    target = StopTarget(("a/rex", "a/beast", "b/rex", "mule"))
    assert target.names_by_edge() == {"a": ["rex", "beast"], "b": ["rex"], "*": ["mule"]}
    assert StopTarget().names_by_edge() == {"*": []}
