"""``fleet history`` and ``fleet release``: who asked what, told by the edge, or read where none runs."""

import json
import re
import time

import msgspec
import pytest

from fleet.bus import keys
from fleet.client.local_user import local_user
from fleet.clock import SystemClock
from fleet.history.event_filter import EventFilter
from fleet.history.record import Record
from fleet.history.store import History
from fleet.host.requests.stop_cause import cause_in
from fleet.model.command import Reply, ReplyStatus, Transport
from fleet.model.event import EventKind, EventReport, Requester

NOW = time.time()
ANNA = Requester(Transport.CLOUD, "anna", "tele")
ROOT = Requester(Transport.LOCAL, "root", proven=True)
DATED = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d[+-]\d\d:\d\d")
RECORDS = [
    Record(NOW - 7200, "rex", EventKind.COMMAND, "takeoff accepted", asker=ANNA, command="takeoff"),
    Record(
        NOW - 60,
        "rex",
        EventKind.STOP,
        "emergency_stop asked: fire in the hall",
        asker=ROOT,
        command="emergency_stop",
        data={"reason": "fire in the hall"},
    ),
]


@pytest.fixture
def yard(play_edge):
    """Play an edge with two robots, one of them stopped; it has ``RECORDS`` of rex."""
    robots = {"rex": {"health": "ok", "emergency_stop": True, "stop_cause": "asked by root"}, "max": {}}
    played = play_edge("yard-1", robots=robots, groups={"all": ["rex", "max"]})
    played.questions = []

    def answer(question):
        wanted = msgspec.json.decode(question.payload, type=EventFilter)
        played.questions.append(wanted)
        question.reply(msgspec.json.encode([record for record in RECORDS if wanted.has(record)]))
        question.close()

    played._control.declare_queryable(keys.history("yard-1"), answer)
    return played


@pytest.fixture
def state(tmp_path, monkeypatch):
    """Return the folder in which edges of this user keep what outlives them."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "fleet"


def test_what_happened_is_shown_with_date_zone_asker_and_how_surely_that_is_known(fleet, yard, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    result = fleet("history")
    first, second = result.out.splitlines()[1:]
    assert DATED.match(first)
    assert "anna (claimed, cloud)" in first
    assert "root (proven, local)" in second
    assert "fire in the hall" in second


def test_since_and_robot_narrow_it_down(fleet, yard):
    assert [each["kind"] for each in fleet("history", "rex", "--since", "1h", "--json").json] == ["stop"]
    assert fleet("history", "max", "--json").json == []
    assert fleet("history", "rex", "--since", "yesterday").code == 2
    assert time.time() - yard.questions[0].since == pytest.approx(3600, abs=60)


def test_a_program_gets_the_time_with_its_zone_the_edge_and_the_asker(fleet, yard):
    last = fleet("history", "--json").json[-1]
    assert last["time"].endswith("+00:00")
    assert (last["edge"], last["robot"]) == ("yard-1", "rex")
    assert last["asker"] == {"way": "local", "name": "root", "proven": True}


def test_an_unknown_robot_is_reported(fleet, yard):
    assert fleet("history", "rx").code == 5


@pytest.mark.parametrize("file", [(), ("-f", "fleet.yaml")])
def test_the_file_is_read_when_no_edge_runs(fleet, runtime, state, file):
    store = History(state / "yard-1", SystemClock())
    store.add("rex", EventReport(NOW, EventKind.STOP, "emergency_stop asked", asker=ANNA))
    store.add("max", EventReport(NOW, EventKind.COMMAND, "takeoff accepted", asker=ANNA))
    store.close()
    (record,) = fleet("history", "rex", "--json", *file).json
    assert (record["edge"], record["text"]) == ("yard-1", "emergency_stop asked")


def test_without_an_edge_and_without_a_file_that_is_reported(fleet, runtime, state):
    assert fleet("history").code == 4


def test_a_release_shows_who_stopped_it_when_and_why_before(fleet, yard):
    requested = yard.answers("rex", Reply("release_emergency_stop", ReplyStatus.ACCEPTED, done=True))
    result = fleet("release", "rex")
    assert result.code == 0
    first, second = result.out.splitlines()
    assert re.match(
        rf"rex: stopped by root \(proven, local\), {DATED.pattern}: fire in the hall", first.replace("\n", "")
    )
    assert "release_emergency_stop" in second
    message = json.loads(requested[0].payload)
    assert (message["command"], message["session_id"]) == ("release_emergency_stop", local_user())


def test_a_release_of_all_releases_who_is_stopped(fleet, yard):
    yard.answers("rex", Reply("release_emergency_stop", ReplyStatus.ACCEPTED, done=True))
    released = fleet("release", "--all", "--json").json["released"]
    assert [(each["robot"], each["stopped"]["asker"]["name"]) for each in released] == [("rex", "root")]


def test_one_that_is_not_stopped_is_reported_and_one_that_is_refused_fails(fleet, yard):
    assert "max: no emergency stop is set" in fleet("release", "max").err
    yard.answers("rex", Reply("release_emergency_stop", ReplyStatus.REJECTED, "stop input pendant is silent"))
    result = fleet("release", "all")
    assert result.code == 5
    assert "pendant is silent" in result.out


def test_who_is_to_be_released_must_be_said(fleet):
    assert fleet("release").code == fleet("release", "rex", "--all").code == 2


def test_a_stop_says_who_asks_and_why(fleet, yard, monkeypatch):
    heard = []
    yard._control.declare_queryable(
        keys.stop("*"), lambda question: (heard.append(question), question.close())
    )
    assert fleet("stop", "rex", "--reason", "fire in the hall").code == 0
    cause = cause_in(heard[0].parameters)
    assert (cause.asker.name, cause.reason, cause.asker.proven) == (local_user(), "fire in the hall", False)
    assert cause.request


def test_every_command_says_who_asks(fleet, yard):
    requested = yard.answers("rex", Reply("takeoff", ReplyStatus.ACCEPTED))
    fleet("send", "rex", "takeoff")
    assert json.loads(requested[0].payload)["session_id"] == local_user()


def test_who_became_root_is_named_as_before():
    assert local_user({"SUDO_USER": "anna", "USER": "root"}).startswith("anna@")
    assert local_user({}).startswith("uid-")
